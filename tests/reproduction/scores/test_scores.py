"""Benchmarks: optima by hand, a bound below every split, and the page that is committed."""

from pathlib import Path

import numpy as np
import pytest

from hevopt.bounds.coarse import COARSE
from hevopt.cli import main
from hevopt.reproduction.scores import page as pages
from hevopt.reproduction.scores import small_hybrid as hybrid
from hevopt.reproduction.scores import small_hybrid_data as data
from hevopt.reproduction.scores.analytic import even_load, on_off

PAGE = Path(__file__).parents[3] / "reports" / "scores.md"


@pytest.mark.parametrize("make, near", [(even_load, 2e-3), (on_off, 1e-6)])
def test_an_optimum_by_hand_lies_between_bound_and_plan(make, near):
    paper = make(21)
    case = pages.found(paper.problem)
    assert case.bound_kg <= paper.best_kg * (1 + 1e-9)
    assert paper.best_kg * (1 - 1e-9) <= case.fuel_kg <= paper.best_kg * (1 + near)


def test_levels_of_which_nothing_is_known_are_flagged_and_bound_too_high():
    paper = even_load(21, known=False)
    case = pages.found(paper.problem)
    assert case.coarse > COARSE and case.bound_kg > paper.best_kg
    assert case.fuel_kg == pytest.approx(pages.found(even_load(21).problem).fuel_kg, rel=1e-9)


@pytest.fixture(scope="module")
def asked():
    """Every ninth second of the cycle, in each gear."""
    whole = hybrid._asked()
    return hybrid._Asked(*(values[::9] for values in whole))


@pytest.mark.parametrize("splits", [8, 21, 100])
def test_no_split_burns_or_draws_less_than_its_cell(asked, splits):
    rng = np.random.default_rng(splits)
    ends = np.linspace(-1.0, 1.0, splits)
    cells = hybrid._cells(asked, ends[:-1], ends[1:])
    shape = (*asked.torque_nm.shape, splits - 1)
    for _ in range(15):
        share = np.minimum(ends[:-1] + rng.random(shape) * np.diff(ends), 1 - 1e-12)
        parts = hybrid._parts(asked, share)
        assert (cells.usable | ~parts.usable).all()
        usable = parts.usable
        assert (cells.fuel_kgps <= parts.fuel_kgps * (1 + 1e-9) + 1e-15)[usable].all()
        assert (cells.power_w <= parts.power_w + 1e-6)[usable].all()


def test_a_split_is_what_the_published_equations_say_by_hand():
    # 10 m/s, 0.5 m/s², third gear (index 2), half of the torque each.
    speed, accel, gear, share = 10.0, 0.5, 2, 0.5
    ratio = 1.21 * 4.06
    mass = (
        2325 / 2.205 - 462 + 136 + 91 + 275 + 251 / 2.205 + 3.2 * 596.9 * 68.7 / 1000
    )  # most engine power is that at 596.9 rad/s
    assert data.MASS_KG == pytest.approx(mass, rel=1e-9)
    force = mass * (9.81 * 0.009 + accel) + 0.5 * 1.2 * 0.335 * 2.0 * speed**2
    wheel = force * 0.282 + 1.6 + 8.0 * mass / 2000
    crank = speed / 0.282 * ratio
    inertia = 0.1 * accel / 0.282 * ratio
    wanted = wheel / 0.95 / ratio + inertia
    three = np.zeros((1, 5)), np.zeros((1, 5)), np.zeros((1, 5))
    asked = hybrid._Asked(*three)
    asked.speed_radps[0, gear], asked.torque_nm[0, gear] = crank, wanted - inertia
    asked.inertia_nm[0, gear] = inertia
    parts = hybrid._parts(asked, np.full((1, 5, 1), share))
    engine = 0.5 * wanted
    assert parts.engine_nm[0, gear, 0] == pytest.approx(engine, rel=1e-12)
    # Between 149.2 and 220.9 rad/s and two torques of the map.
    assert 149.2 < crank < 220.9 and 20.4 < engine < 27.2
    a, b = (engine - 20.4) / 6.8, (crank - 149.2) / 71.7
    at = [
        [443.8 * 149.2 * 20.4, 387.4 * 149.2 * 27.2],
        [407.6 * 220.9 * 20.4, 350.1 * 220.9 * 27.2],
    ]
    rows = [low * (1 - a) + high * a for low, high in at]
    fuel = (rows[0] * (1 - b) + rows[1] * b) / 3.6e9
    assert parts.fuel_kgps[0, gear, 0] == pytest.approx(fuel, rel=1e-9)
    assert parts.usable[0, gear, 0]


def test_finer_splits_burn_less_and_none_less_than_the_bound_of_all():
    coarse, finer = (pages.found(hybrid.split_problem(splits)) for splits in (21, 41))
    least_kg, _, _ = pages.bound(hybrid.relaxed_problem(401))
    assert coarse.coarse > COARSE
    assert coarse.fuel_kg > finer.fuel_kg > least_kg
    assert least_kg < finer.bound_kg < coarse.bound_kg
    row = next(line for line in PAGE.read_text().splitlines() if line.startswith("| 21 |"))
    assert row.startswith(f"| 21 | {coarse.fuel_kg * 1e3:.2f} | {coarse.bound_kg * 1e3:.2f} |")


@pytest.mark.long
def test_the_whole_committed_page_is_made_by_the_command():
    told = pages.scored(lambda *_: None)
    assert pages.page(told) == PAGE.read_text()
    # The bound of all splits is as near as 0.3 % to the plan of the most.
    assert told.splits[-1][1].fuel_kg / told.all_splits_kg < 1.003


def test_the_command_refuses_another_kind_of_file(monkeypatch, capsys):
    monkeypatch.setattr("sys.argv", ["hevopt", "scores", "--out", "scores.html"])
    with pytest.raises(SystemExit) as stop:
        main()
    assert stop.value.code == 2 and "ends in .md" in capsys.readouterr().err
