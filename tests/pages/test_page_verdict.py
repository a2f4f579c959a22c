"""The sentences at the top say what the rows say, and nothing is kept back."""

import json
from types import SimpleNamespace

from hevopt.pages.results import Results
from hevopt.pages.verdict import alerts, best_rows, verdict

CHECKS = ["Steps not followed", "Charge balance", "Map edges and limits", "Certificates", "Solvers"]


def changed(nedc, change):
    contents = json.loads(nedc.results.model_dump_json())
    change(contents)
    return Results.model_validate(contents)


def figures(contents, car, strategy):
    return next(
        row["figures"]
        for row in contents["rows"]
        if (row["figures"]["architecture"], row["figures"]["strategy"]) == (car, strategy)
    )


def by_name(results):
    return {alert.name: alert for alert in alerts(results)}


def test_the_best_row_is_the_one_of_least_corrected_fuel(nedc):
    rows = [row.figures for row in nedc.results.rows]
    least = min(row.fuel_corrected_l_per_100km for row in rows)
    best = best_rows(nedc.results)
    assert all(row.fuel_corrected_l_per_100km <= 1.0005 * least for row in best)
    assert (best[0].architecture, best[0].strategy) == ("C2", "dp")
    first, second = verdict(nedc.results)
    assert f"{best[0].fuel_l_per_100km:.4f} l/100 km" in first and "C2 ecms" in first
    assert f"{-best[0].delta_fuel_percent:.1f} % less than A baseline" in first
    assert f"{best[0].gap_percent:.3f} % above a proven lower bound" in second


def test_a_row_with_an_alert_is_not_the_best_while_another_has_none(nedc):
    def spoil(contents):
        for strategy in ("dp", "ecms"):
            figures(contents, "C2", strategy)["status"] = "not neutral"

    assert best_rows(changed(nedc, spoil))[0].architecture == "E"


def test_nothing_to_say_is_said(nedc):
    found = by_name(nedc.results)
    assert list(found) == CHECKS
    assert all(alert.lines for alert in found.values())
    assert [name for name, alert in found.items() if alert.found] == ["Map edges and limits"]


def test_every_kind_of_alert_names_its_row(nedc):
    def spoil(contents):
        contents["cars"]["B"]["missing_torque_nm"][7:9] = [12.0, 30.0]
        figures(contents, "D", "ecms").update(status="not neutral", delta_energy_percent=-1.5)
        contents["cars"]["E"]["certified_gap_percent"] = 0.31
        contents["failures"]["C1 mpc"] = "no plan\n  at step 3"
        contents["rows"][5]["detail"]["solver"] = ["4 previews solved by the second solver"]

    found = by_name(changed(nedc, spoil))
    assert all(alert.found for alert in found.values())
    assert [name for name, alert in found.items() if not alert.grave] == ["Map edges and limits"]
    assert found["Steps not followed"].lines == [
        "B: 2 of 1180 steps, up to 30 Nm short at the wheels (at 7 s, 8 s); driven with what there is."
    ]
    assert "D ecms" in found["Charge balance"].lines[0]
    assert "−1.50 %" in found["Charge balance"].lines[0]
    assert "E: dynamic programming lies 0.31 %" in found["Certificates"].lines[0]
    assert (
        found["Solvers"].lines[0] == "C1 mpc: no plan" and "previews" in found["Solvers"].lines[2]
    )


def test_with_a_weight_on_nox_the_sum_is_ranked(nedc):
    def weigh(contents):
        contents["nox_weight"] = 20.0
        figures(contents, "C2", "dp").update(bound_l_per_100km=9.0)
        figures(contents, "C2", "ecms").update(bound_l_per_100km=9.0)

    results = changed(nedc, weigh)
    assert best_rows(results)[0].architecture == "E"
    assert "fuel plus 20 times NOx" in verdict(results)[0] and "of that sum" in verdict(results)[1]


def test_a_comparison_without_any_result_says_so():
    empty = SimpleNamespace(rows=[], cars={}, failures={"A": "cannot follow"})
    assert "No case could be solved" in verdict(empty)[0]
