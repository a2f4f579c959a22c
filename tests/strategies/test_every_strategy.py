"""Whatever the drive, a strategy ends: with a plan that simulates, or with one message."""

import sys
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
from conftest import HYBRIDS
from hypothesis import given, settings
from hypothesis import strategies as st

import hevopt
from hevopt import HevoptError, build_problem, load_architecture, load_cycle, simulate
from hevopt.driving.cycle import Cycle
from hevopt.files.lookup import shipped_names
from hevopt.strategies import STRATEGIES, ecms, fitting

# Calls of hevopt's functions: many times what the dearest of these drives takes.
CALLS_MAX = 50_000
LEVELS = 7
PACKAGE = str(Path(hevopt.__file__).parent)


class Endless(Exception):
    """More calls than any search needs."""


@contextmanager
def limited_calls(most=CALLS_MAX):
    """Counts calls, not seconds: the same verdict on a busy machine, compiled kernels and their compiling apart."""
    made = 0

    def count(frame, event, argument):
        nonlocal made
        if event == "call":
            file = frame.f_code.co_filename
            made += file.startswith(PACKAGE) and not file.endswith("kernels.py")
            if made > most:
                raise Endless(f"more than {most} calls")

    before = sys.getprofile()
    sys.setprofile(count)
    try:
        yield
    finally:
        sys.setprofile(before)


def cycle_of(speed_mps, grade=0.0, name="drive"):
    speed = np.asarray(speed_mps, dtype=float)
    return Cycle(
        name, np.arange(len(speed), dtype=float), speed, np.broadcast_to(grade, speed.shape)
    )


def solved(architecture, cycle, strategy):
    """The trajectory of a strategy on a drive, None where it said in one line why there is none."""
    car = load_architecture(architecture)
    try:
        problem = build_problem(car, cycle, levels=LEVELS, allow_shortfall=True)
        with limited_calls():
            plan = STRATEGIES[strategy].solve(problem)
        return simulate(problem, plan.control)
    except HevoptError as error:
        assert str(error) and "\n" not in str(error).strip().split("\n  ")[0]
        return None


@st.composite
def drives(draw):
    """Stretches of steady, coasting and accelerating driving, up and down hills, of 5 to 60 steps in all."""
    speed, grade = [draw(st.sampled_from([0.0, 3.0, 8.6, 16.7, 25.0]))], [0.0]
    for _ in range(draw(st.integers(1, 4))):
        slope = draw(st.sampled_from([-0.08, -0.05, -0.03, -0.01, 0.0, 0.0, 0.02, 0.05]))
        change = draw(st.sampled_from([-1.5, -0.5, -0.27, -0.1, 0.0, 0.0, 0.3, 1.0]))
        for _ in range(draw(st.integers(5, 15))):
            speed.append(min(max(speed[-1] + change, 0.0), 30.0))
            grade.append(slope)
    return cycle_of(speed, np.array(grade))


@given(drive=drives(), architecture=st.sampled_from(("A", "B", *HYBRIDS)))
@settings(max_examples=20, deadline=None, derandomize=True, database=None)
def test_a_strategy_ends_on_any_drive(drive, architecture):
    for strategy in fitting(load_architecture(architecture).functions):
        solved(architecture, drive, strategy)


@pytest.mark.parametrize("architecture", ["C2", "D", "E"])
@pytest.mark.parametrize("strategy", ["ecms", "dp"])
def test_downhill_and_coasting_need_no_fuel(architecture, strategy):
    downhill = cycle_of(np.full(120, 60 / 3.6), -0.03, "downhill")
    coasting = cycle_of(np.linspace(90, 31, 61) / 3.6, 0.0, "coasting")
    for drive in (downhill, coasting):
        trajectory = solved(architecture, drive, strategy)
        assert trajectory.total_fuel_kg == 0.0, drive.name
        assert trajectory.soc[-1] >= trajectory.soc[0]


def test_ecms_ends_where_only_a_factor_of_nothing_leaves_too_little_charge():
    """Under every factor above 0 the small battery is charged on the way: none is neutral."""
    drive = load_cycle("nedc")
    car = load_architecture("C2", {"battery.capacity_ah": 1.75})
    with limited_calls():
        problem = build_problem(car, drive)
        trajectory = simulate(problem, ecms.solve(problem).control)
    assert trajectory.end_j >= problem.end_min_j


def test_a_call_limit_ends_what_does_not_end():
    with pytest.raises(Endless), limited_calls(1000):
        while True:
            shipped_names("cycles", ".csv")
