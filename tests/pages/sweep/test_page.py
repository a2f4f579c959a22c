"""The page of a sweep: its figures by hand and against brute force, and as a reader uses it, in a real browser."""

import csv
import io
import json
import re
from dataclasses import fields
from time import process_time

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from page_helpers import Opened, until
from typer.testing import CliRunner

from hevopt.cli import application
from hevopt.files.lookup import shipped_folder
from hevopt.pages.render import fixed
from hevopt.pages.sweep import data as sweep_data
from hevopt.pages.sweep import drawing as sweep_drawing
from hevopt.pages.sweep.alerts import alerts
from hevopt.pages.sweep.data import Sweep, load_sweep, summary_of
from hevopt.pages.sweep.drawing import plane_of
from hevopt.pages.sweep.effects import effect
from hevopt.pages.sweep.front import boundary, lines_boundary, pareto
from hevopt.pages.sweep.page import sweep_page, unit_of
from hevopt.pages.sweep.verdict import groups_of, verdict
from hevopt.studies.rows import Row
from hevopt.sweeps.plan.jobs import FIGURES, Ending, Failure, Planned, Result
from hevopt.sweeps.plan.prune import Pruned
from hevopt.sweeps.plan.study_file import read_study
from hevopt.sweeps.run import begin, plan_of
from hevopt.sweeps.store.export import export
from hevopt.sweeps.store.reading import Record, open_to_read
from hevopt.sweeps.store.store import open_store
from hevopt.sweeps.workers.work import run_job

steady = settings(derandomize=True, deadline=None, database=None)
STUDY = """architecture = "C2"
cycles = ["nedc"]
strategies = ["ecms", "dp"]
[parameters]
battery.cells_in_series = [64, 80]
machine.power_max_w = [12e3, 24e3]
nox_weight = [0, 10]
"""
PER_NOX = 0.1 / 835
FIELDS = [f.name for f in fields(Row) if f.name != "solve_s"] + [*FIGURES]


def row_of(fuel, nox, weight, *, bound=None, strategy="dp", status="ok", gained=0.0):
    """A row as a store has it. gained: worth of the charge gained, in fuel."""
    objective = fuel - gained + weight * nox * PER_NOX
    bound = fuel + weight * nox * PER_NOX if bound is None else bound
    return dict.fromkeys(FIELDS) | {
        "architecture": "X", "strategy": strategy, "status": status, "fuel_l_per_100km": fuel,
        "nox_mg_per_km": nox, "fuel_corrected_l_per_100km": fuel - gained, "bound_l_per_100km": bound,
        "gap_percent": 0.0, "objective_l_per_100km": objective, "objective_bound_l_per_100km": bound - gained,
    }  # fmt: skip


def record(
    design, row, *, weight=0.0, cycle="nedc", strategy="dp", outcome="ok", error=None, **values
):
    parameters = {"a.length_mm": design, "nox_weight": weight} | values
    failure = error and Failure(error)
    return Record(design, parameters, cycle, strategy, weight, Ending(outcome), row, failure, 0.1)


def solved(design, fuel, nox=100.0, weight=0.0, **values):
    return record(design, row_of(fuel, nox, weight), weight=weight, **values)


def sweep_of(records, pruned=(), **meta):
    figures, tally = summary_of(records)
    return Sweep("s.sqlite", meta, figures, tally, list(pruned), None)


def said(sweep, name):
    """(whether there is something to say, the lines) of an alert."""
    found = next(a for a in alerts(sweep, groups_of(sweep.figures)) if a.name == name)
    return found.found, found.lines


def test_a_design_is_the_mean_over_cycles_of_its_best_strategies():
    figures, tally = summary_of(
        [
            record(0, row_of(4.0, 100, 0, bound=3.9), cycle="a"),
            record(0, row_of(3.8, 300, 0, bound=3.9 - 0.2, strategy="ecms"), cycle="a", strategy="ecms"),
            record(0, row_of(6.0, 50, 0, bound=5.0), cycle="b"),
            record(0, None, cycle="b", strategy="ecms", outcome="failed", error="no"),
            record(1, row_of(1.0, 1, 0), cycle="a"),
            record(1, None, cycle="b", outcome="missing"),
        ]
    )  # fmt: skip
    assert figures.objective[0] == pytest.approx((3.8 + 6.0) / 2)
    assert figures.nox[0] == pytest.approx((300 + 50) / 2)
    assert figures.bound[0] == pytest.approx((3.7 + 5.0) / 2)
    assert figures.gap_percent[0] == pytest.approx(100 * (4.9 / 4.35 - 1))
    assert figures.strategy[0] == "ecms, dp"
    assert np.isnan([figures.objective[1], figures.bound[1], figures.gap_percent[1]]).all()
    assert dict(tally.counts) == {"ok": 4, "failed": 1, "missing": 1}


def test_a_bound_is_charge_corrected_as_the_row_is_and_never_above_its_objective():
    figures, tally = summary_of([record(0, row_of(4.0, 100, 0, bound=3.9, gained=0.25))])
    assert figures.objective[0] == figures.fuel[0] == 3.75
    assert figures.bound[0] == pytest.approx(3.65)
    assert tally.contradictions == 0
    figures, tally = summary_of([record(0, row_of(4.0, 100, 0, bound=4.1))])
    assert tally.contradictions == 1 and figures.bound[0] == 4.0


def test_bounds_alone_rank_designs_where_nothing_else_was_asked_for():
    row = dict.fromkeys(FIELDS) | {"strategy": "bound", "status": "ok"}
    records = [
        record(n, row | {"objective_bound_l_per_100km": b}, strategy="bound")
        for n, b in enumerate([3.0, 2.5, 4.0])
    ]
    sweep = sweep_of(records)
    assert groups_of(sweep.figures)[0].ranked.tolist() == [1, 0, 2]
    assert (
        "Design 1 (a.length_mm 1) has the least bound"
        in verdict(sweep, groups_of(sweep.figures))[0]
    )
    assert "<h1>Sweep s.sqlite</h1>" in sweep_page(sweep)


def test_what_a_milligram_of_nox_counts_is_found_from_the_rows():
    figures, _ = summary_of([solved(0, 4.0), solved(1, 4.0, 200.0, 10.0)])
    assert figures.fuel_per_nox == pytest.approx(PER_NOX)
    assert summary_of([solved(0, 4.0)])[0].fuel_per_nox is None


def test_the_front_has_what_no_other_point_beats():
    fuel = np.array([3.0, 2.0, 2.0, 1.0, 4.0, np.nan])
    nox = np.array([1.0, 5.0, 4.0, 9.0, 1.0, 0.0])
    assert pareto(fuel, nox).tolist() == [3, 2, 0]
    assert pareto(fuel[:0], nox[:0]).tolist() == []


numbers = st.integers(0, 12).map(float)


@steady
@given(st.lists(st.tuples(numbers, numbers), min_size=1, max_size=12))
def test_the_front_is_that_of_comparing_all_pairs(points):
    fuel, nox = np.array(points).T
    front = {points[n] for n in pareto(fuel, nox)}
    beaten = {p for p in points for q in points if q != p and q[0] <= p[0] and q[1] <= p[1]}
    assert front == set(points) - beaten


def test_the_boundary_of_one_car_has_its_corner_where_two_half_planes_meet():
    nothing = np.full((1, 2), np.nan)
    found = boundary(np.array([0.0, 0.01]), np.array([[3.0, 4.0]]), nothing, nothing, (0.0, 300.0))
    assert found.edge.nox == pytest.approx([0, 100, 300])
    assert found.edge.fuel == pytest.approx([4, 3, 3])
    assert found.lowered == 0


def test_the_boundary_of_two_cars_is_the_lower_of_their_edges():
    bounds = np.array(
        [[3.0, 5.0], [3.5, 4.0], [3.6, 5.5]]
    )  # the last is nowhere lower than the first
    nothing = np.full((3, 2), np.nan)
    found = boundary(np.array([0.0, 0.01]), bounds, nothing, nothing, (0.0, 300.0))
    nox = np.linspace(0, 300, 61)
    first, second = np.maximum(3, 5 - 0.01 * nox), np.maximum(3.5, 4 - 0.01 * nox)
    assert found.edge.at(nox) == pytest.approx(np.minimum(first, second))


def test_without_any_bound_there_is_no_boundary():
    nothing = np.full((2, 1), np.nan)
    assert boundary(np.zeros(1), nothing, nothing, nothing, (0.0, 1.0)) is None
    assert lines_boundary(np.zeros(2), nothing[:, 0], (0.0, 1.0)) is None


def test_a_bound_is_lowered_to_a_plan_found_under_another_weight_and_says_so():
    slopes, bounds = np.array([0.0, 0.01]), np.array([[3.0, 4.0]])
    fuel, nox = np.array([[3.0, 2.9]]), np.array([[200.0, 150.0]])
    found = boundary(slopes, bounds, fuel, nox, (0.0, 300.0))
    assert found.lowered == pytest.approx(0.1)
    assert found.edge.at(np.array([150.0, 200.0])) == pytest.approx([2.9, 2.9])


plan = st.tuples(st.floats(2, 6), st.floats(0, 400))


@steady
@given(
    cars=st.lists(st.lists(plan, min_size=1, max_size=5), min_size=1, max_size=6),
    weights=st.lists(st.sampled_from([0.0, 1.0, 3.0, 10.0, 30.0]), min_size=1, max_size=4, unique=True),
    slack=st.floats(0, 0.1),
    gaps=st.randoms(use_true_random=False),
)  # fmt: skip
def test_no_plan_of_any_car_with_a_bound_lies_below_the_boundary(cars, weights, slack, gaps):
    slopes = np.sort(np.array(weights)) * 1e-3
    costs = [np.array([[f + s * x for f, x in plans] for s in slopes]) for plans in cars]
    bounds = np.array([cost.min(axis=1) - slack for cost in costs])
    best = [cost.argmin(axis=1) for cost in costs]
    fuel, nox = (
        np.array([[plans[n][k] for n in own] for plans, own in zip(cars, best, strict=True)])
        for k in (0, 1)
    )
    for matrix in (bounds, fuel):
        matrix[np.array([[gaps.random() < 0.2 for _ in weights] for _ in cars])] = np.nan
    found = boundary(slopes, bounds, fuel, nox, (0.0, 400.0))
    bounded = ~np.isnan(bounds).all(axis=1)
    assert (found is None) == (not bounded.any())
    for plans, covered in zip(cars, bounded, strict=True):
        for plan_fuel, plan_nox in plans if covered else []:
            assert plan_fuel >= found.edge.at(np.array(plan_nox))
    # Nor is it lower than it must be: brute force over cars and half planes.
    for x in np.linspace(0, 400, 9) if bounded.any() else []:
        exact = min(np.nanmax(bounds[n] - slopes * x) for n in np.flatnonzero(bounded))
        assert found.edge.at(np.array(x)) == pytest.approx(exact, abs=1e-9)


@steady
@given(st.lists(st.tuples(st.floats(0, 0.02), st.floats(2, 6)), min_size=1, max_size=20))
def test_designs_with_weights_of_their_own_make_the_lower_envelope_of_their_lines(lines):
    slopes, bounds = np.array(lines).T
    found = lines_boundary(slopes, bounds, (10.0, 400.0))
    for x in np.linspace(10, 400, 14):
        least = (bounds - slopes * x).min()
        assert least - 1e-9 <= found.edge.at(np.array(x)) <= least


def test_designs_of_several_weights_share_a_car_and_those_of_many_do_not():
    cars = [(n, k, 10.0 * k) for n in range(9) for k in range(2)]
    shared = [solved(2 * n + k, 4.0 + n, 100.0, w, **{"a.length_mm": n}) for n, k, w in cars]
    figures, _ = summary_of(shared)
    plane, _ = plane_of(figures, groups_of(figures))
    assert plane["edge"]["fuel"][-1] == pytest.approx(4.0)  # bounded at weight 0 as well
    own = [solved(n, 4.0 + n, 100.0, 1.0 + n) for n in range(21)]
    figures, _ = summary_of(own)
    plane, _ = plane_of(figures, groups_of(figures))
    assert [g["label"] for g in plane["groups"]] == ["all"]
    assert plane["edge"]["fuel"][-1] < 4.0


def test_an_effect_has_means_bests_and_share_as_by_hand():
    found = effect("k", [2, 1, 2, 1], np.array([5.0, 1.0, 7.0, 3.0]))
    assert (found.values, found.mean, found.best, found.count) == ([1, 2], [2, 6], [1, 5], [2, 2])
    # Between: 4 designs 2 from the mean; whole: 3, 1, 1, 3 from it.
    assert found.share == pytest.approx(16 / 20) and found.chance == pytest.approx(1 / 3)
    assert found.numeric and not found.binned and not found.log


def test_many_numbers_are_put_into_bins_in_logarithms_where_they_span_much():
    values = np.linspace(0, 8, 801)
    found = effect("k", values.tolist(), values)
    assert found.binned and found.count == [100] * 7 + [101]
    assert found.low == pytest.approx(range(8)) and found.high == pytest.approx(range(1, 9))
    assert found.best == pytest.approx(range(8)) and found.values[0] == 0.5
    values = np.geomspace(1, 256, 100)
    found = effect("k", values.tolist(), values)
    assert found.log and found.low == pytest.approx([2.0**n for n in range(8)])
    assert found.values[0] == pytest.approx(2**0.5) and sum(found.count) == 100


def test_texts_and_truths_are_values_of_their_own_and_nothing_to_explain_has_no_share():
    found = effect("k", ["b", "a", "b"], np.array([1.0, 2.0, 3.0]))
    assert (found.values, found.mean, found.numeric) == (["b", "a"], [2, 2], False)
    assert found.share == 0
    assert effect("k", [True, False], np.array([1.0, 2.0])).values == ["true", "false"]
    flat = effect("k", [1, 2], np.array([3.0, 3.0]))
    assert flat.share is None and flat.chance is None


@pytest.mark.parametrize(
    ("key", "unit"),
    [("machine.power_max_w", "W"), ("battery.cells_in_series", ""), ("nox_weight", "kg/kg"),
     ("gearbox.ratios.0", ""), ("engine", ""), ("battery.capacity_ah", "Ah")],
)  # fmt: skip
def test_a_parameter_has_the_unit_of_its_key(key, unit):
    assert unit_of(key) == unit


def test_the_verdict_names_the_best_of_each_weight_and_counts_cases():
    records = [
        record(0, row_of(4.0, 100, 0, bound=3.96)), solved(1, 5.0), solved(2, 3.0, 1000.0, 10.0),
        record(3, None, weight=10.0, outcome="missing"),
    ]  # fmt: skip
    sweep = sweep_of(records)
    first, second = verdict(sweep, groups_of(sweep.figures))
    assert (
        "At NOx weight 0, design 0 (a.length_mm 0) is the best: 4.0000 l/100 km, 1.010 % above"
        in first
    )
    assert (
        f"at NOx weight 10, design 2 (a.length_mm 2) is the best: {3 + 1e4 * PER_NOX:.4f}" in first
    )
    assert second == "4 designs, 4 cases: 3 done, 0 failed, 0 infeasible, 1 missing, 0 pruned."


def test_nothing_solved_is_said_and_shown():
    sweep = sweep_of([record(0, None, outcome="failed", error="SolverError: x")])
    assert verdict(sweep, groups_of(sweep.figures))[0] == "No design is solved."
    assert "No design is solved, so there is no fuel and NOx to show." in sweep_page(sweep)


def test_failures_alike_but_for_numbers_are_one_line_and_the_most_frequent_comes_first():
    errors = ["rare"] + [f"no control at step {n} (t = {n}.5 s)" for n in range(5)]
    sweep = sweep_of([record(n, None, outcome="failed", error=e) for n, e in enumerate(errors)])
    found, lines = said(sweep, "Failed cases")
    assert found and lines == [
        "5 cases, such as design 1: no control at step 0 (t = 0.5 s)", "1 case, design 0: rare",
    ]  # fmt: skip
    assert said(sweep, "Infeasible cases") == (False, ["No case is infeasible."])


def test_an_incomplete_sweep_says_how_to_go_on():
    sweep = sweep_of([record(0, None, outcome="missing")], command="hevopt sweep s.toml")
    found, lines = said(sweep, "Completeness")
    assert (
        found and lines[0].startswith("1 of 1 cases") and lines[1].endswith(": hevopt sweep s.toml")
    )
    assert not said(sweep_of([solved(0, 4.0)]), "Completeness")[0]


def test_a_best_design_at_the_end_of_a_range_is_noted():
    inner = sweep_of([solved(n, abs(n - 1) + 4.0) for n in range(3)])
    assert not said(inner, "Parameter ranges")[0]
    outer = sweep_of([solved(n, 4.0 - n / 10) for n in range(3)])
    found, lines = said(outer, "Parameter ranges")
    assert found and "a.length_mm = 2, the largest tried" in lines[0]


def test_loose_bounds_rivals_and_cases_off_balance_are_alerts():
    rows = [
        row_of(4.0, 1, 0),
        row_of(4.1, 1, 0, bound=3.9, status="not neutral"),
    ]
    sweep = sweep_of([record(n, row) for n, row in enumerate(rows)])
    found, lines = said(sweep, "Certificates")
    assert found and "up to 5.13 % (design 1)" in lines[0]
    assert "1 other design could be better" in lines[1]
    assert said(sweep, "Charge balance")[1][0] == "1 case: not neutral."
    tight = sweep_of([solved(n, 4.0 + n) for n in range(2)])
    found, lines = said(tight, "Certificates")
    assert not found and "No other design can be better" in lines[1]


def many(count):
    random = np.random.default_rng(1)
    for n in range(count):
        weight, share = (0.0, 10.0)[n % 2], random.random(3).tolist()
        yield solved(
            n, 3 + share[0] + share[1] / 9, 200 + 99 * share[2], weight, **{"b.mass_kg": share[0]}
        )


def test_of_many_designs_the_front_and_the_best_are_always_drawn(monkeypatch):
    monkeypatch.setattr(sweep_drawing, "POINTS_MAX", 500)
    monkeypatch.setattr(sweep_drawing, "CELLS", 10)
    figures, _ = summary_of(many(5000))
    groups = groups_of(figures)
    plane, words = plane_of(figures, groups)
    shown = {d for g in plane["groups"] for d in g["design"]}
    assert shown >= set(plane["front"]["design"]) and len(shown) < 500
    assert shown >= {int(n) for group in groups for n in group.ranked[:20]}
    assert any(f"{len(shown)} of 5000 points" in line for line in words)
    lines = sweep_drawing.drawn(figures, groups, [[], []], plane)["groups"][0]["lines"]
    assert len(lines["design"]) == 1000 and lines["all"] == 2500
    assert lines["design"][::-1][:300] == groups[0].ranked[:300].tolist()


@pytest.mark.long
def test_a_hundred_thousand_cases_make_a_page_of_less_than_12_mb_in_linear_time():
    """How many seconds that is, tests/benchmarks/pages.py tells."""

    def made(count: int) -> tuple[str, float]:
        sweep = sweep_of(list(many(count)))
        began = process_time()
        return sweep_page(sweep), process_time() - began

    page, seconds = made(100_000)
    assert len(page.encode()) < 12e6
    # Ten times as many cases: quadratic work would take a hundred times as long.
    assert seconds < 30 * made(10_000)[1]


class Made:
    """A small real sweep in its store, and its page as the command writes it."""

    def __init__(self, folder):
        study = folder / "study.toml"
        study.write_text(STUDY)
        self.store, self.path = folder / "study.sqlite", folder / "page.html"
        planned = plan_of(read_study(study))
        with open_store(self.store) as store:
            begin(planned, store, "hevopt sweep study.toml")
            for job in planned.jobs:
                store.add(run_job(job))
        words = ["report", str(self.store), "--out", str(self.path)]
        self.result = CliRunner().invoke(application(), words)
        self.sweep = load_sweep(self.store)


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    return Made(tmp_path_factory.mktemp("sweep"))


@pytest.fixture(scope="module")
def viewed(browser, made):
    """The page of the small sweep, opened once."""
    found = Opened(browser, made.path, viewport={"width": 1440, "height": 1000})
    yield found
    found.context.close()


def test_the_command_report_makes_the_page_of_a_store(made, tmp_path):
    assert made.result.exit_code == 0, made.result.output
    text = made.path.read_text(encoding="utf-8")
    assert "<h1>Sweep study.toml</h1>" in text and "architecture C2 · 8 designs" in text
    assert made.path.stat().st_size < 3e6
    other = tmp_path / "other.sqlite"
    other.write_bytes(b"SQLite format 3\0 and no more")
    done = CliRunner().invoke(
        application(), ["report", str(other), "--out", str(tmp_path / "x.html")]
    )
    assert done.exit_code != 0 and not (tmp_path / "x.html").exists()


def test_no_design_of_a_real_sweep_lies_below_the_boundary(made):
    plane, _ = plane_of(made.sweep.figures, groups_of(made.sweep.figures))
    edge = plane["edge"]
    assert len(edge["nox"]) > 2
    for group in plane["groups"]:
        least = np.interp(group["nox"], edge["nox"], edge["fuel"])
        assert (np.array(group["fuel"]) >= least).all()


CELLS = """() => [...document.querySelectorAll('#best tbody tr')].map(row => Object.fromEntries(
  [...row.cells].filter(cell => cell.dataset.key)
    .map(cell => [cell.dataset.key, [cell.textContent.trim(), cell.dataset.value]])))"""
COLUMNS = {
    "objective": ("objective_l_per_100km", ".4f"),
    "fuel": ("fuel_corrected_l_per_100km", ".4f"),
    "nox": ("nox_mg_per_km", ".1f"),
}


def test_every_number_of_the_table_is_that_of_the_store(made, viewed):
    page = viewed.page
    shown = page.evaluate(CELLS)
    with open_to_read(made.store) as reader:
        records = list(reader.records())
    assert len(shown) == 8
    for line in shown:
        own = [r for r in records if r.design == int(line["design"][1])]
        best = min(own, key=lambda r: r.row["objective_l_per_100km"])
        assert line["strategy"][0] == best.strategy
        for key, (name, form) in COLUMNS.items():
            assert float(line[key][1]) == best.row[name]
            assert line[key][0] == fixed(best.row[name], form)
        gap = 100 * (float(line["objective"][1]) / float(line["bound"][1]) - 1)
        assert 0 <= float(line["gap"][1]) == pytest.approx(gap, abs=1e-9)


def test_the_download_is_what_the_export_writes(made, viewed, tmp_path):
    page = viewed.page
    with page.expect_download() as waiting:
        page.click("#download")
    with open_to_read(made.store) as reader:
        assert export(reader, tmp_path / "cases.csv") == 16
    with open(waiting.value.path(), "rb") as file:
        assert file.read() == (tmp_path / "cases.csv").read_bytes()


def test_with_too_many_cases_the_download_is_a_line_per_design(made, monkeypatch):
    monkeypatch.setattr(sweep_data, "CASES_MAX", 15)
    sweep = load_sweep(made.store)
    assert sweep.cases_csv is None
    lines = list(csv.DictReader(io.StringIO(sweep_data.designs_csv(sweep.figures).decode())))
    assert [int(line["design"]) for line in lines] == list(range(8))
    objectives = [float(line["objective_l_per_100km"]) for line in lines]
    assert objectives == pytest.approx(sweep.figures.objective.tolist(), rel=1e-9)
    assert "Download all designs (CSV)" in sweep_page(sweep)


AXES = """() => [...document.querySelectorAll('.plot')].filter(p => p.id !== 'parallel')
  .flatMap(plot => Object.entries(plot._fullLayout)
  .filter(([name]) => /^[xy]axis[0-9]*$/.test(name)).map(([name, axis]) => axis.title.text))"""


def test_using_the_page_logs_nothing_asks_for_nothing_and_does_what_it_says(viewed):
    page = viewed.page
    titles = page.evaluate(AXES)
    assert len(titles) == 6 and all(re.search(r"\(.+\)$", title) for title in titles), titles

    heads = page.locator("#best thead th")
    heads.nth(4).locator("button").focus()
    page.keyboard.press("Enter")
    page.keyboard.press("Enter")
    values = page.evaluate(
        "[...document.querySelectorAll('#best tbody tr')].map(r => Number(r.cells[4].dataset.value))"
    )
    assert (
        values == sorted(values, reverse=True)
        and heads.nth(4).get_attribute("aria-sort") == "descending"
    )

    level = "document.getElementById('effects')._fullData[0].y[0]"
    before = page.evaluate(level)
    page.select_option("#effects-weight", "1")
    assert page.evaluate(level) > before and page.input_value("#parallel-weight") == "1"

    page.locator("#parallel").scroll_into_view_if_needed()
    area = page.locator("#parallel .nsewdrag").bounding_box()
    left = area["x"] + area["width"] * 0.12 / 4.24  # five axes; the first is that of the cells
    page.mouse.move(left, area["y"] + 2)
    page.mouse.down()
    page.mouse.move(left + 3, area["y"] + 0.7 * area["height"], steps=3)
    page.mouse.up()
    assert "2 of 4 drawn designs are within" in page.locator("#kept").inner_text()
    page.click("#let-go")
    assert page.locator("#kept").inner_text().startswith("4 designs are drawn")

    page.emulate_media(color_scheme="dark")
    page.set_viewport_size({"width": 400, "height": 800})
    until(page, "document.getElementById('parallel')._fullLayout.paper_bgcolor === '#14181c'")
    until(page, "document.documentElement.scrollWidth === 400")
    assert viewed.trouble == []
    assert {url.split(":")[0] for url in viewed.requests} <= {"file", "blob"}


def test_names_and_errors_from_files_stay_text(opened, tmp_path):
    evil = "<script>document.title='taken'</script><b>bold</b>{{7*7}}&amp;"
    path, planned, outcomes = tmp_path / "s.sqlite", [], []
    for n in range(8):
        row = row_of(4.0 + n, 100.0, 0.0, strategy=evil) if n < 6 else None
        planned.append(Planned(n, evil, evil, 0.0, str(n)))
        ending, failure = ("ok", None) if row else ("failed", Failure(evil))
        outcomes.append(Result(str(n), ending, row, failure, 0.1))
    with open_store(path) as store:
        designs = [(n, {"engine": f"{evil}{n % 2}", f"x.{evil}": n}) for n in range(9)]
        store.begin(
            {"study": evil, "command": evil, evil: evil},
            designs,
            [*planned, Planned(8, evil, evil, 0.0, "8")],
        )
        store.add(outcomes)
        store.prune([Pruned(8, 5.0, 0, 4.0)])
    page_file = tmp_path / "page.html"
    page_file.write_text(sweep_page(load_sweep(path)), encoding="utf-8")
    found = opened(page_file)
    page = found.page
    assert found.trouble == [] and page.title() == "Sweep s.sqlite"
    assert page.locator("b", has_text=re.compile("^bold$")).count() == 0
    assert page.locator("svg tspan[style*=bold]", has_text=re.compile("^bold$")).count() == 0
    assert (
        page.locator("#failures tbody tr").count() == 2
        and page.locator("#pruned tbody tr").count() == 1
    )
    assert evil in page.locator("#failures tbody").inner_text()
    assert page.locator("#study").inner_text() == evil
    assert page.locator("script").count() == 5  # data, table, library as text and as code, ours


def short(design, fuel, steps, **values):
    row = row_of(fuel, 100.0, 0.0, status=f"shortfall at {steps} step{'s' if steps > 1 else ''}")
    return record(design, row, **values)


def test_a_design_that_does_not_follow_the_cycle_is_never_the_best_and_says_so():
    sweep = sweep_of([short(0, 3.0, 9), solved(1, 5.0), solved(2, 4.0), short(3, 2.9, 1)])
    groups = groups_of(sweep.figures)
    assert groups[0].ranked.tolist() == [2, 1, 3, 0]
    assert verdict(sweep, groups)[0].startswith("Design 2 ")
    # No weight was asked for, so none is shown.
    text = re.sub(r"<(style|script).*?</\1>", "", sweep_page(sweep), flags=re.S)
    assert "weight" not in text.lower()  # none was asked for
    found, lines = said(sweep, "Steps not followed")
    assert found and "2 of 4 designs" in lines[0] and "up to 9 steps (design 0)" in lines[0]
    plane, words = plane_of(sweep.figures, groups)
    assert plane["front"]["design"] == [2] and plane["short"]["design"] == [0, 3]
    assert min(plane["edge"]["fuel"]) == pytest.approx(4.0) and any("Crosses" in w for w in words)
    only = sweep_of([short(0, 3.0, 9)])
    assert "No design that follows the cycle has a bound." in sweep_page(only)
    assert "No solved design follows the cycle" in verdict(only, groups_of(only.figures))[0]
    assert not said(sweep_of([solved(0, 4.0)]), "Steps not followed")[0]


def test_pruned_designs_are_drawn_by_their_bound_and_what_they_would_change_is_withheld():
    records = [solved(n, 4.0 + n, **{"b.kind": "x"}) for n in range(2)]
    records += [record(n, None, outcome="pruned", **{"b.kind": "y"}) for n in (2, 3)]
    sweep = sweep_of(records, [Pruned(2, 4.75, 0, 4.0), Pruned(3, 4.5, 0, 4.0)])
    plane, words = plane_of(sweep.figures, groups_of(sweep.figures), sweep.pruned)
    assert plane["pruned"]["fuel"] == [4.5, 4.75] and plane["pruned"]["nox"] == [100.0, 100.0]
    assert any("the front is incomplete" in line for line in words)
    assert said(sweep, "Pruned designs")[0]
    found = effect("b.kind", ["x", "x"], sweep.figures.objective[:2], [("y", 4.75), ("y", 4.5)])
    assert (found.best, found.floor, found.mean, found.share) == (
        [4, None],
        [None, 4.5],
        None,
        None,
    )
    assert "Withheld where designs were pruned." in sweep_page(sweep)
    # With a weight the mark lies on the edge of the half plane, at the NOx of the design it lost to.
    sweep = sweep_of([solved(0, 4.0, 200.0, 10.0), record(1, None, weight=10.0, outcome="pruned")])
    plane, _ = plane_of(sweep.figures, groups_of(sweep.figures), [Pruned(1, 4.5, 0, 4.2)])
    assert plane["pruned"]["fuel"] == pytest.approx([4.5 - 2000 * PER_NOX], rel=1e-6)


def test_twenty_weights_are_compared_one_by_one_and_of_more_no_design_is_the_best():
    few = sweep_of([solved(n, 4.0, 100.0, float(n)) for n in range(20)])
    said_first = verdict(few, groups_of(few.figures))[0]
    assert len(groups_of(few.figures)) == 20 and "at NOx weight 19, design 19" in said_first
    assert "1: design 1, 2: design 2, 3: design 3" in said_first
    many_weights = sweep_of([solved(n, 4.0, 100.0, float(n)) for n in range(21)])
    groups = groups_of(many_weights.figures)
    assert verdict(many_weights, groups)[0].startswith(
        "Objectives of 21 NOx weights do not compare"
    )
    page = sweep_page(many_weights)
    assert "is the best" not in page and "Withheld: objectives of so many NOx weights" in page
    assert said(many_weights, "NOx weights")[0]


def test_the_page_shows_versions_and_inputs_where_the_store_has_them():
    page = sweep_page(
        sweep_of([solved(0, 4.0)], versions='{"numpy": "1.2.3"}', inputs='{"c.csv": "ab12"}')
    )
    assert "<td>1.2.3</td>" in page and '<th scope="row">c.csv</th><td><code>ab12</code>' in page
    without = sweep_page(sweep_of([solved(0, 4.0)]))
    assert "computed-by" not in without and 'id="files"' not in without


def test_a_logarithmic_axis_is_said_to_be_one():
    spread = sweep_of([solved(n, 4.0 + n, **{"b.mass_kg": 10.0**n}) for n in range(3)])
    assert "An axis marked “log”" in sweep_page(spread)
    assert "An axis marked “log”" not in sweep_page(
        sweep_of([solved(n, 4.0 + n) for n in range(3)])
    )


def test_a_weight_of_which_no_design_follows_says_that_there_is_nothing_to_show(opened, tmp_path):
    records = [short(0, 3.0, 9), *(solved(n, 4.0 + n, 200.0, 10.0) for n in (1, 2))]
    path = tmp_path / "page.html"
    path.write_text(sweep_page(sweep_of(records)), encoding="utf-8")
    found = opened(path)
    assert found.page.locator("#kept").inner_text().startswith("No design is drawn.")
    found.page.select_option("#parallel-weight", "1")
    assert found.page.locator("#kept").inner_text().startswith("2 designs are drawn.")
    assert found.trouble == []


def test_the_page_names_no_folder_of_the_user():
    shipped = str(shipped_folder("architectures") / "C2.toml")
    study, car = "/home/x/studies/study.toml", "/home/x/studies/cars/mine.toml"
    files = {study: "1", car: "2", "/home/x/nedc.csv": "3", shipped: "4", "local.csv": "5"}
    sweep = sweep_of([solved(0, 4.0)], inputs=json.dumps(files), study_file=study)
    page = sweep_page(sweep)
    assert "/home/x" not in page and ">study_file</th><td><code>study.toml<" in page
    names = re.findall('<th scope="row">(.*?)</th><td><code>[1-5]<', page)
    assert names == [
        "study.toml",
        "cars/mine.toml",
        "nedc.csv",
        "architectures/C2.toml",
        "local.csv",
    ]
    assert list(sweep.inputs) == list(files)
