"""ADVISOR's cycles in .mat files: cyc_grade over distance reaches the road, matrices lying down are read."""

import numpy as np
import pytest
import scipy.io

from hevopt.errors import DataError
from hevopt.measured.cycles.cycle import import_cycle

TIME_S = np.arange(121.0)
SPEED_KMH = np.interp(TIME_S, [0, 10, 30, 100, 115, 120], [0, 0, 72, 72, 0, 0])
CYCLE = np.c_[TIME_S, SPEED_KMH]
DRIVEN_M = np.r_[0, np.cumsum((SPEED_KMH[1:] + SPEED_KMH[:-1]) / 7.2)]
CONSTANT = np.array([[0, 0.03], [1, 0.03]])


def imported(tmp_path, **variables):
    path = tmp_path / "cycle.mat"
    scipy.io.savemat(path, variables)
    return import_cycle(path)


def refusal(tmp_path, **variables):
    with pytest.raises(DataError) as error:
        imported(tmp_path, **variables)
    return str(error.value)


@pytest.mark.parametrize("grade", [CONSTANT, 0.03, np.array([[0, 0.03], [5000, 0.03]])])
@pytest.mark.parametrize("name", ["cyc_kph", "cyc_mph"])
def test_a_constant_grade_reaches_the_cycle(tmp_path, grade, name):
    speeds = CYCLE / [1, 1.609344 if name == "cyc_mph" else 1]
    result = imported(tmp_path, **{name: speeds, "cyc_grade": grade, "cyc_description": "x"})
    assert result.cycle.grade == pytest.approx(0.03, abs=1e-9)
    assert any(
        text.startswith("grade: cyc_grade in fraction (MATLAB conv") for text in result.assumptions
    )


def test_a_grade_over_distance_keeps_its_climb(tmp_path):
    # Up 5 % from 300 to 500 m, 0 beyond 700 m, each linear between.
    table = np.array([[0, 0], [300, 0], [300.001, 0.05], [500, 0.05], [700, 0], [800, 0]])
    climb_m = 0.05 * 200 + 0.05 * 200 / 2
    cycle = imported(tmp_path, cyc_kph=CYCLE, cyc_grade=table).cycle
    assert np.sum(cycle.grade[:-1] * np.diff(DRIVEN_M)) == pytest.approx(climb_m, rel=1e-3)
    inside = (DRIVEN_M[:-1] > 301) & (DRIVEN_M[1:] < 499)
    assert cycle.grade[:-1][inside] == pytest.approx(0.05)
    assert cycle.grade[:-1][DRIVEN_M[1:] < 300] == pytest.approx(0)


@pytest.mark.parametrize(
    "grade", [0.0, np.zeros((2, 2)), np.array([[0, 0], [1, 0]]), np.array([[0.0, 0.0]])]
)
def test_no_grade_is_said(tmp_path, grade):
    result = imported(tmp_path, cyc_kph=CYCLE, cyc_grade=grade)
    assert "cyc_grade: 0 everywhere" in result.assumptions and not result.cycle.grade.any()


@pytest.mark.parametrize(
    ("grade", "part"),
    [
        (np.c_[TIME_S, 0.01 + 0 * TIME_S], "the first column of cyc_grade is the time of the cycle"),
        (np.array([[0, 0.1, 0.1], [1, 0.1, 0.1]]), "cyc_grade is 2 x 3; needed: two columns, distance in m"),
        (np.array([[5, 0.1], [1, 0.1]]), "distance in m that rises"),
        (np.full((121, 1), 0.1), "cyc_grade is 121 x 1; needed"),
        (np.array([[5, 1], [1, 1]], np.uint8), "distance in m that rises"),
        (np.array([[0, 0.1], [1, np.inf]]), "needed: two columns"),
        (np.array([[0, 0.1]]), "cyc_grade is 1 x 2; needed"),
        ("steep", "cyc_grade is no real numbers; needed"),
    ],
)  # fmt: skip
def test_a_grade_of_another_form_is_refused(tmp_path, grade, part):
    assert part in refusal(tmp_path, cyc_kph=CYCLE, cyc_grade=grade)


def test_a_grade_without_a_cycle_to_lay_it_along_is_refused(tmp_path):
    for spoilt in (CYCLE[::-1], np.where(CYCLE == 50, np.nan, CYCLE), np.c_[CYCLE, TIME_S]):
        assert "cyc_grade needs a cycle" in refusal(tmp_path, cyc_kph=spoilt, cyc_grade=CONSTANT)


def test_a_matrix_that_lies_down_is_read_and_said(tmp_path):
    upright, lying = (imported(tmp_path, cyc_kph=c) for c in (CYCLE, CYCLE.T))
    assert np.array_equal(upright.cycle.speed_mps, lying.cycle.speed_mps)
    assert "cyc_kph: 2 x 121, its rows read as columns" in lying.assumptions
