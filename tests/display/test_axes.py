"""Plots: on new axes or on those given, with units on every axis, and only where they are asked for."""

from collections.abc import Iterator
from dataclasses import replace

import matplotlib
import numpy as np
import pytest
from matplotlib import pyplot
from problems import random_problem

from hevopt import DataError, InfeasibleError, load_cycle, simulate, solve
from hevopt.driving.cycle import Cycle
from hevopt.studies.comparison import Comparison
from hevopt.studies.rows import Row
from hevopt.studies.status import Mark, Status


@pytest.fixture(autouse=True)
def closed_afterwards() -> Iterator[None]:
    matplotlib.use("Agg")
    yield
    pyplot.close("all")


def labels(drawn) -> list[str]:
    return [axes.get_ylabel() for axes in drawn]


def drawn_values(axes) -> list[float]:
    """What the only level line of axes shows."""
    (stairs,) = axes.patches
    return stairs.get_data().values.tolist()


@pytest.fixture
def trajectory(problem_of):
    problem = problem_of("C2", "cadc_urban")
    return simulate(problem, solve(problem, "ecms").control)


def test_a_trajectory_shows_speed_powers_charge_and_fuel_with_units(trajectory):
    drawn = trajectory.plot()
    assert labels(drawn) == ["speed, km/h", "power, kW", "SOC", "fuel so far, g"]
    assert drawn[-1].get_xlabel() == "time, s"
    table, pack = trajectory.problem.table, trajectory.problem.battery
    assert max(drawn_values(drawn[0])) == pytest.approx(3.6 * table.signals.speed_mps.max())
    names = [text.get_text() for text in drawn[1].get_legend().get_texts()]
    assert names == ["wheels", "engine", "battery"]
    assert (drawn[2].lines[0].get_ydata() == trajectory.soc).all()
    heights = [line.get_ydata()[0] for line in drawn[2].lines[1:]]
    assert heights == [pack.soc_min, pack.soc_max]
    assert drawn[3].lines[0].get_ydata()[-1] == pytest.approx(1e3 * trajectory.total_fuel_kg)
    assert drawn[0].get_xlim()[1] > table.time_s[-1]


def test_a_trajectory_of_arrays_alone_shows_what_it_has():
    for seed in range(20):
        problem = random_problem(seed)
        try:
            trajectory = simulate(problem, solve(problem).control)
        except InfeasibleError:
            continue
        assert labels(trajectory.plot()) == ["power, kW", "SOC", "fuel so far, g"]
        return
    pytest.fail("no random problem could be solved")


def test_axes_that_are_given_are_drawn_on_and_returned(trajectory):
    _, given = pyplot.subplots(4, 1)
    assert trajectory.plot(given) == list(given)
    figures = pyplot.get_fignums()
    with pytest.raises(DataError, match=r"3 axes were given to draw on; needed: 4, as of pyplot"):
        trajectory.plot(given[:3])
    cycle = replace(load_cycle("hwfet"), name="$x$")
    assert cycle.plot(given[:1]) == [given[0]] and given[0].get_title(loc="left").startswith(
        r"\$x\$"
    )
    comparison = Comparison("c", [Row("A", "dp", Status(), 4.5)])
    assert comparison.plot(given[0]) is given[0]
    assert pyplot.get_fignums() == figures


def test_a_cycle_shows_gears_and_grade_where_it_has_them():
    assert labels(load_cycle("hwfet").plot()) == ["speed, km/h"]
    assert labels(load_cycle("nedc").plot()) == ["speed, km/h", "gear"]
    hill = Cycle("hill", np.arange(3.0), np.array([0.0, 9.0, 9.0]), np.array([0.0, 0.05, 0.05]))
    drawn = hill.plot()
    assert labels(drawn) == ["speed, km/h", "grade, %"]
    assert drawn_values(drawn[1]) == [0.0, 5.0]
    assert drawn[0].get_title(loc="left") == "hill, 0.01 km"


ROWS = [
    Row("A", "baseline", Status(failure="too steep")),
    Row("B", "ecms", Status(), 4.0, bound_l_per_100km=3.9, gap_percent=100 * (4.0 / 3.9 - 1)),
    Row("$B$", "dp", Status(Mark.NOT_NEUTRAL), 3.95, bound_l_per_100km=3.95, gap_percent=-0.0),
]


def test_a_comparison_shows_what_each_row_needs_beside_its_bound():
    axes = Comparison("nedc", ROWS).plot()
    names = [text.get_text() for text in axes.get_yticklabels()]
    assert names == ["A  baseline", "B  ecms", r"\$B\$  dp"]
    said = [text.get_text() for text in axes.texts]
    assert said == [" failed", "4.000, gap 2.564 %", "3.950, gap 0.000 %, not neutral"]
    assert axes.get_xlabel() == "fuel, l/100 km"
    dots = [line.get_xdata()[0] for line in axes.lines if line.get_marker() == "o"]
    strokes = [line.get_xdata()[0] for line in axes.lines if line.get_marker() == "|"]
    assert dots == [4.0, 3.95] and strokes == [3.9, 3.95]
    legend = [text.get_text() for text in axes.get_legend().get_texts()]
    assert legend == ["proven bound", "reached", "reached, marked"]


def test_with_a_weight_on_nox_the_sum_stands_beside_the_bound():
    row = replace(ROWS[1], bound_l_per_100km=5.0, gap_percent=1.0)
    axes = Comparison("nedc", [row], nox_weight=10.0).plot()
    assert axes.get_xlabel() == "fuel + 10 x NOx as fuel, l/100 km"
    assert [text.get_text() for text in axes.texts] == ["5.050, gap 1.000 %"]


@pytest.mark.parametrize("rows", [[], ROWS[:1]])
def test_a_comparison_without_figures_is_drawn_too(rows):
    axes = Comparison("nedc", rows).plot()
    axes.figure.canvas.draw()
    assert len(axes.get_yticklabels()) == len(rows) and axes.get_legend() is None


def test_every_plot_can_be_drawn_to_its_last_letter(trajectory):
    for axes in (trajectory.plot()[0], load_cycle("nedc").plot()[0], Comparison("c", ROWS).plot()):
        axes.figure.canvas.draw()
        assert np.asarray(axes.figure.canvas.buffer_rgba()).std() > 5
