"""What a trajectory does: modes of operation, spells of engine on and off, limits touched."""

from collections.abc import Mapping
from itertools import groupby

import numpy as np
from numpy.typing import NDArray

from hevopt.car.architecture import Architecture
from hevopt.pages.comparison.results import Share
from hevopt.problem.problem import Problem, Trajectory
from hevopt.problem.table import ControlTable

Array = NDArray[np.float64]

OPERATIONS = (
    "standing, engine off",
    "standing, engine on",
    "braking, recovering",
    "braking, not recovering",
    "electric driving",
    "engine alone",
    "engine, machine assists",
    "engine, charging",
)
# A machine or battery power of less than this is none.
_POWER_MIN_W = 1.0
_NEAR = 0.01
_WINDOW_NEAR = 0.002


def operations_of(trajectory: Trajectory, table: ControlTable) -> NDArray[np.int64]:
    """(time,) index into OPERATIONS.

    Standing: no speed. Braking: the wheels give power; recovering: the battery takes some. Driving: electric
    without fuel; else by what the machine does: assists, or charges the battery, or neither.
    """
    f, power = trajectory.flows, trajectory.battery_power_w
    standing, braking = table.signals.speed_mps == 0, f["wheel_power_w"] < 0
    machine = f["machine_power_w"]
    tests = [
        standing & ~engine_on(trajectory, table),
        standing,
        braking & (power < -_POWER_MIN_W),
        braking,
        f["fuel_power_w"] == 0,
        (machine <= _POWER_MIN_W) & (power >= -_POWER_MIN_W),
        machine > _POWER_MIN_W,
    ]
    return np.select(tests, np.arange(len(tests)), len(tests))


def engine_on(trajectory: Trajectory, table: ControlTable) -> NDArray[np.bool_]:
    """(time,) whether the engine turns, with or without fuel."""
    return np.array([table.controls[c].engine_on for c in trajectory.control])


def shares_of(
    trajectory: Trajectory, table: ControlTable, operation: NDArray, *, nox_known: bool
) -> list[Share]:
    """Time, distance, fuel and NOx of every mode of operation that occurs."""
    distance = table.signals.speed_mps * table.step_s
    return [
        Share(
            operation=name,
            time_s=float(np.sum(table.step_s[here])),
            distance_m=float(np.sum(distance[here])),
            fuel_kg=float(np.sum(trajectory.fuel_kg[here])),
            nox_kg=float(np.sum(trajectory.nox_kg[here])) if nox_known else None,
        )
        for code, name in enumerate(OPERATIONS)
        if (here := operation == code).any()
    ]


def spells_s(on: NDArray[np.bool_], step_s: Array) -> tuple[list[float], list[float]]:
    """Lengths of the spells of true and of false, in their order."""
    lengths: dict[bool, list[float]] = {True: [], False: []}
    for state, steps in groupby(zip(on.tolist(), step_s.tolist(), strict=True), lambda s: s[0]):
        lengths[state].append(sum(step for _, step in steps))
    return lengths[True], lengths[False]


def limits_touched(car: Architecture, problem: Problem, trajectory: Trajectory) -> dict[str, int]:
    """Name of a limit -> steps that end within 1 % of it, or of the SOC window's width 0.2 %."""
    f, pack = trajectory.flows, problem.battery
    torque, speed = f["engine_torque_nm"], f["engine_speed_radps"]
    fired = f["fuel_power_w"] > 0
    current = f["battery_current_a"]
    width = _WINDOW_NEAR * (pack.soc_max - pack.soc_min)
    low, high = (
        trajectory.soc[1:] <= pack.soc_min + width,
        trajectory.soc[1:] >= pack.soc_max - width,
    )
    near = {
        "engine full load": fired & (torque >= (1 - _NEAR) * car.engine.full_load_nm(speed)),
        "engine top speed": speed >= (1 - _NEAR) * car.engine.speed_max_radps,
        "edge of the engine map": fired & car.engine.law.near_edge(torque, speed, _NEAR),
        **_near_machine_limits(car, f),
        "battery power": _near_battery_limit(problem, trajectory.battery_power_w, current),
        "SOC window": low | high,
    }  # fmt: skip
    return {name: int(np.sum(steps)) for name, steps in near.items() if steps.any()}


def _near_machine_limits(
    car: Architecture, flows: Mapping[str, Array]
) -> dict[str, NDArray[np.bool_]]:
    names = [name for name, _ in car.driveline.machines]
    near = {}
    for name, machine in zip(names, car.machines, strict=True):
        torque, speed = np.abs(flows[f"{name}_torque_nm"]), np.abs(flows[f"{name}_speed_radps"])
        shown = name.replace("_", " ")
        limit = machine.limit_nm(speed)
        near[f"{shown} torque or power"] = (torque >= (1 - _NEAR) * limit) & (torque > 0)
        near[f"{shown} top speed"] = speed >= (1 - _NEAR) * machine.speed_max_radps
    return near


def _near_battery_limit(problem: Problem, power: Array, current: Array) -> NDArray[np.bool_]:
    pack, share = problem.battery, 1 - _NEAR
    return (
        (power >= share * pack.power_max_discharge_w)
        | (-power >= share * pack.power_max_charge_w)
        | (current >= share * pack.current_max_discharge_a)
        | (-current >= share * pack.current_max_charge_a)
    )
