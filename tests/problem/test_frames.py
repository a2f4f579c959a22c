"""Plans and control tables as tables of pandas."""

import numpy as np
import pytest
from problems import random_problem

from hevopt import ControlTable, InfeasibleError, simulate, solve


def test_a_trajectory_has_a_line_per_step_with_states_at_both_ends(problem_of):
    problem = problem_of("C2", "cadc_urban")
    trajectory = simulate(problem, solve(problem, "ecms").control)
    frame = trajectory.to_frame()
    assert len(frame) == len(problem.table.time_s) and frame.columns.is_unique
    for state in ("soc", "energy"):
        unit = "_j" if state == "energy" else ""
        start, end = (frame[f"{state}_{side}{unit}"].to_numpy() for side in ("start", "end"))
        assert (start[1:] == end[:-1]).all()
    assert frame["energy_end_j"].iloc[-1] == trajectory.end_j
    assert frame["soc_start"].iloc[0] == pytest.approx(problem.soc_start)
    assert frame["fuel_kg"].sum() == pytest.approx(trajectory.total_fuel_kg, rel=1e-12)
    steps = np.arange(len(frame))
    power_w = problem.table.battery_power_w[steps, frame["control"]]
    assert (frame["battery_power_w"] == power_w).all()
    assert (frame["mode"] == problem.table.mode[frame["control"]]).all()
    assert frame["engine_on"].dtype == bool and set(frame["engine_on"]) == {True, False}
    assert (frame["fuel_kg"][~frame["engine_on"]] == 0).all()
    assert frame.filter(like="residual").abs().to_numpy().max() < 1e-6
    units = {"s", "m", "mps", "j", "kg", "w", "nm", "radps", "v", "a"}
    plain = {
        "gear", "clutch_open", "control", "mode", "engine_on", "engine_gear_chosen", "machine_gear", "level",
        "soc_start", "soc_end",
    }  # fmt: skip
    assert {name for name in frame if name.rpartition("_")[2] not in units} == plain


def test_a_trajectory_of_arrays_alone_is_a_table_too():
    for seed in range(20):
        problem = random_problem(seed)
        try:
            trajectory = simulate(problem, solve(problem).control)
        except InfeasibleError:
            continue
        frame = trajectory.to_frame()
        assert frame["time_s"].tolist() == problem.table.time_s.tolist()
        assert "speed_mps" not in frame and frame["level"].tolist() == [
            str(c) for c in trajectory.control
        ]
        return
    pytest.fail("no random problem could be solved")


def test_a_control_table_has_a_line_per_step_and_control_and_says_why_one_cannot_be_used():
    fuel = np.array([[1.0, 2.0], [3.0, 4.0], [5.0, 6.0]]) * 1e-4
    feasible = np.array([[True, True], [True, False], [False, True]])
    table = ControlTable.from_arrays(fuel, -fuel, feasible, step_s=2.0, mode=[0, 1])
    frame = table.to_frame()
    assert frame["step"].tolist() == [0, 0, 1, 1, 2, 2]
    assert frame["time_s"].tolist() == [0.0, 0.0, 2.0, 2.0, 4.0, 4.0]
    assert frame["control"].tolist() == frame["mode"].tolist() == [0, 1] * 3
    assert (frame["fuel_kg"] == table.fuel_kg.ravel()).all()
    assert frame["feasible"].tolist() == feasible.ravel().tolist()
    given = "marked as not feasible"
    assert frame["rejected"].tolist() == ["", "", "", given, given, ""]


def test_every_reason_of_a_rejected_control_is_in_words(problem_of):
    frame = problem_of("C2", "cadc_urban").table.to_frame()
    assert (frame["feasible"] == (frame["rejected"] == "")).all()
    assert frame["rejected"].str.contains("engine torque, machine torque or power").any()
