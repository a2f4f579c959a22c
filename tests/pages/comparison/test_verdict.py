"""The sentences at the top say what the rows say, and nothing is kept back."""

import json
import re
from types import SimpleNamespace

import pytest

from hevopt.pages.comparison.alerts import alerts
from hevopt.pages.comparison.page import comparison_page
from hevopt.pages.comparison.results import Results
from hevopt.pages.comparison.verdict import best_rows, corrected_cost, verdict
from hevopt.pages.words import explained

CHECKS = [
    "Steps not followed", "Charge balance", "Map edges and limits", "Short spells of the engine", "Certificates",
    "Solvers",
]  # fmt: skip


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


def said(results):
    """The verdict with plain spaces."""
    return [sentence.replace("\u00a0", " ") for sentence in verdict(results)]


def by_name(results):
    return {alert.name: alert for alert in alerts(results)}


def test_the_best_row_is_the_one_of_least_corrected_fuel(nedc):
    rows = [row.figures for row in nedc.results.rows]
    least = min(row.fuel_corrected_l_per_100km for row in rows)
    best = best_rows(nedc.results)
    assert all(row.fuel_corrected_l_per_100km <= 1.0005 * least for row in best)
    assert {row.architecture for row in best} == {"C2"}
    assert {"dp", "ecms"} <= {row.strategy for row in best}
    away = [abs(row.delta_energy_percent) for row in best]
    assert away == sorted(away)
    first, second, third = said(nedc.results)
    assert f"{best[0].fuel_corrected_l_per_100km:.4f} l/100 km, charge-corrected" in first
    assert f"as driven: fuel {best[0].fuel_l_per_100km:.4f} l/100 km, " in first
    assert all(f"C2 {row.strategy}" in first for row in best[1:])
    assert f"{best[0].gap_percent:.3f} % above a proven lower bound" in second
    # A baseline is causal, and has no choice.
    assert third.startswith("No strategy here that has a choice is causal, ")


def test_the_best_causal_row_stands_beside_the_optimum(nedc):
    results = changed(nedc, lambda contents: contents.update(causal=["baseline", "conventional"]))
    rows = {(row.figures.architecture, row.figures.strategy): row.figures for row in results.rows}
    own, best = rows["C2", "conventional"], best_rows(results)[0]
    above = 100 * (own.fuel_corrected_l_per_100km / best.fuel_corrected_l_per_100km - 1)
    assert said(results)[2] == (
        "The best causal strategy, one that does not know the rest of the cycle, is C2 conventional: "
        f"{own.fuel_corrected_l_per_100km:.4f} l/100 km, {above:.1f} % above {best.architecture} {best.strategy}."
    )


def test_no_line_ends_between_a_number_and_its_unit(nedc):
    text = " ".join(verdict(nedc.results))
    assert "\u00a0l/100\u00a0km" in text and "\u00a0%" in text
    assert not re.search(r"\d (?:%|l/|g |mg )|l/100 km", text)


def test_the_change_is_of_corrected_figures_on_both_sides(nedc):
    def spoil(contents):
        figures(contents, "A", "baseline").update(
            fuel_corrected_l_per_100km=2.0, status="not neutral"
        )
        figures(contents, "C2", "dp").update(delta_fuel_percent=5.9)

    results = changed(nedc, spoil)
    best = best_rows(results)[0]
    percent = 100 * (best.fuel_corrected_l_per_100km / 2.0 - 1)
    assert (
        f"{percent:.1f} % more than A baseline, itself marked not neutral (both charge-corrected)"
        in said(results)[0]
    )
    assert "5.9" not in said(results)[0]
    captions = re.findall("<(?:fig)?caption.*", comparison_page(results))
    marked = [text for text in captions if "against A baseline, itself marked not neutral." in text]
    assert len(marked) == 3


def test_a_row_with_an_alert_is_not_the_best_while_another_has_none(nedc):
    def spoil(contents):
        for strategy in ("dp", "ecms", "conventional"):
            figures(contents, "C2", strategy)["status"] = "not neutral"

    assert best_rows(changed(nedc, spoil))[0].architecture == "E"


def test_nothing_to_say_is_said(nedc):
    found = by_name(nedc.results)
    assert list(found) == CHECKS
    assert all(alert.lines for alert in found.values())
    notes = ["Map edges and limits", "Short spells of the engine"]
    assert [name for name, alert in found.items() if alert.found] == notes


def test_every_kind_of_alert_names_its_row(nedc):
    def spoil(contents):
        contents["cars"]["B"]["missing_torque_nm"][7:9] = [12.0, 30.0]
        figures(contents, "D", "ecms").update(status="not neutral", delta_energy_percent=-1.5)
        contents["cars"]["E"]["certified_gap_percent"] = 0.31
        contents["lost_proofs"] = {"C2, LP prices": "HiGHS stopped"}
        contents["failures"]["C1 mpc"] = "no plan\n  at step 3"
        contents["rows"][5]["detail"]["solver"] = ["4 previews solved by the second solver"]

    found = by_name(changed(nedc, spoil))
    assert all(alert.found for alert in found.values())
    assert [name for name, alert in found.items() if not alert.grave] == [CHECKS[2], CHECKS[3]]
    assert found["Steps not followed"].lines == [
        "B: 2 of 1180 steps, up to 30 Nm short at the wheels (at 7 s, 8 s); driven with what there is."
    ]
    assert "D ecms" in found["Charge balance"].lines[0]
    assert "−1.50 %" in found["Charge balance"].lines[0]
    assert "E: dynamic programming lies 0.31 %" in found["Certificates"].lines[0]
    assert found["Certificates"].lines[1] == "C2, LP prices: tried and not found: HiGHS stopped."
    assert (
        found["Solvers"].lines[0] == "C1 mpc: no plan" and "previews" in found["Solvers"].lines[2]
    )


def test_with_a_weight_on_nox_the_sum_is_ranked(nedc):
    def weigh(contents):
        contents["nox_weight"] = 20.0
        figures(contents, "C2", "dp").update(bound_l_per_100km=9.0)
        figures(contents, "C2", "ecms").update(bound_l_per_100km=9.0)
        figures(contents, "C2", "conventional").update(bound_l_per_100km=9.0)
        figures(contents, "A", "baseline").update(bound_l_per_100km=8.0)

    results = changed(nedc, weigh)
    assert best_rows(results)[0].architecture == "E"
    first, second, _ = said(results)
    assert "fuel plus 20 times NOx" in first and "of that sum" in second
    best, base = best_rows(results)[0], results.rows[0].figures
    percent = 100 * (1 - corrected_cost(best) / corrected_cost(base))
    assert round(percent, 1) != round(-best.delta_fuel_percent, 1)
    assert f", {percent:.1f} % less than A baseline" in first
    fuel = f"fuel {best.fuel_l_per_100km:.4f} l/100 km (−{-best.delta_fuel_percent:.1f} %)"
    assert fuel in first and f"mg NOx/km (+{best.delta_nox_percent:.1f} %)" in first


@pytest.mark.parametrize(
    ("status", "says"),
    [
        ("not neutral", "stored energy changes by −1.50 % of the fuel's energy"),
        ("end charge missed", "the charge asked at the end is missed by −1.50 % of"),
        ("end charge above, shortfall at 2 steps", "the charge at the end is above that asked by"),
        ("of a later version", "of a later version"),
    ],
)
def test_every_mark_of_the_charge_raises_its_alert(nedc, status, says):
    def spoil(contents):
        figures(contents, "D", "ecms").update(status=status, delta_energy_percent=-1.5)

    found = by_name(changed(nedc, spoil))["Charge balance"]
    assert found.found and found.lines[0].startswith(f"D ecms: {says}")


def test_a_failed_row_raises_an_alert_even_without_its_message(nedc):
    def spoil(contents):
        contents["rows"][5]["detail"] = None
        contents["rows"][5]["figures"]["status"] = "failed: no plan"

    found = by_name(changed(nedc, spoil))
    assert found["Solvers"].lines == ["C1 nox_cut: failed: no plan."] and found["Solvers"].found
    assert not found["Charge balance"].found


def test_an_asked_end_charge_is_said_in_verdict_and_notes(nedc):
    assert len(verdict(nedc.results)) == 3
    results = changed(nedc, lambda contents: contents.update(end_asked={"C2": 0.5, "D": 0.5}))
    sentence = said(results)[3]
    assert "not the start's: 0.5 in C2, D" in sentence and "is not counted as fuel" in sentence
    assert comparison_page(results).count("is not counted as fuel, nor in any change") == 2


def _burn_nothing(contents):
    contents["cars"]["C2"]["certified_gap_percent"] = None
    figures(contents, "C2", "dp").update(
        fuel_l_per_100km=0.0, fuel_corrected_l_per_100km=0.0, co2_g_per_km=0.0,
        bound_l_per_100km=0.0, gap_percent=None, delta_energy_percent=None,
    )  # fmt: skip


def test_a_trip_without_fuel_cannot_be_lower(nedc):
    results = changed(nedc, _burn_nothing)
    assert said(results)[1] == "It cannot be lower: nothing is burnt, and 0 is the bound."
    found = by_name(results)["Certificates"]
    assert not found.found
    assert found.lines[0] == "C2: cannot be lower than the 0 that it burns."


def test_no_certificate_is_a_note(nedc):
    def spoil(contents):
        contents["cars"]["C2"]["certified_gap_percent"] = None

    found = by_name(changed(nedc, spoil))["Certificates"]
    assert found.found and not found.grave
    assert found.lines[0] == "C2: the bound is 0; it holds nothing."


def test_a_comparison_without_any_result_says_so():
    empty = SimpleNamespace(rows=[], cars={}, failures={"A": "cannot follow"})
    assert "No case could be solved" in verdict(empty)[0]


def test_a_causal_row_that_is_itself_among_the_best_is_said_to_be_so(nedc):
    def spoil(contents):
        contents["causal"] += [best_rows(nedc.results)[0].strategy, "conventional"]

    assert said(changed(nedc, spoil))[2] == (
        "It is causal: it decides without knowing the rest of the cycle."
    )


def test_the_best_causal_row_is_marked_where_its_charge_is_off(nedc):
    def spoil(contents):
        contents["causal"] = ["conventional"]
        figures(contents, "C2", "conventional")["status"] = "not neutral"

    causal = said(changed(nedc, spoil))[2]
    assert "is C2 conventional, itself marked not neutral: 3.1" in causal
    best = best_rows(nedc.results)[0]
    assert causal.endswith(f"0.8 % above {best.architecture} {best.strategy}.")

    def of_another_car(contents):
        contents["causal"] = ["nox_cut"]
        figures(contents, "C2", "nox_cut")["status"] = "shortfall at 2 steps"

    assert said(changed(nedc, of_another_car))[2].endswith(" above the least of E, E dp.")
    nobody = changed(nedc, lambda contents: contents.update(causal=[]))
    assert len(verdict(nobody)) == 2


def test_short_spells_are_those_within_the_cycle(nedc):
    def still(contents, *on):
        """C2 dp with an engine that turns in some steps alone; no other row has a trace that turns."""
        for row in contents["rows"]:
            trace = row["detail"]["trace"]
            is_own = row["figures"]["architecture"] == "C2" and row["figures"]["strategy"] == "dp"
            steps = range(len(trace["engine_speed_radps"]))
            trace["engine_speed_radps"] = [100.0 * (is_own and k in on) for k in steps]

    def spells(*on):
        return by_name(changed(nedc, lambda contents: still(contents, *on)))[CHECKS[3]]

    assert spells(*range(100, 110), 111, *range(115, 130)).lines == [
        f"C2 dp: {figures(json.loads(nedc.results.model_dump_json()), 'C2', 'dp')['engine_starts']} starts, "
        "shortest off 1 s, shortest on 1 s."
    ]
    # Cut off by the cycle's ends, or long enough.
    assert not spells(*range(1, 1179)).found
    assert not spells(*range(100, 103)).found


def test_words_of_the_trade_are_explained_once_and_text_stays_text():
    shown = str(explained("<b>causal</b> and causal, over the tabulated controls"))
    assert shown.count("<abbr") == 2 and shown.startswith("&lt;b&gt;<abbr")
    assert str(explained("noncausal")) == "noncausal"
