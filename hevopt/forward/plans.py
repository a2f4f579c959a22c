"""What a driver is to do with engine and gears: a plan made backward, replayed, or what a strategy decides."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np

from hevopt.car.architecture import Architecture
from hevopt.car.driveline import State
from hevopt.display.facts import Shown
from hevopt.errors import DataError
from hevopt.forward._free_kernels import FreeCourse
from hevopt.forward.lines import Line
from hevopt.powertrain.flows import PowerFlows
from hevopt.problem.arrays import Array, Flags, Indices
from hevopt.problem.dwell import RepeatedFlows
from hevopt.problem.problem import Trajectory
from hevopt.problem.table import ControlTable, Signals


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class ForwardPlan(Shown):
    """A plan over the steps of a cycle, as the loop follows it.

    way: (time,) index of a Line; engine_on: (time,)
    open_while: (time,) the clutch is open: 0 never, 1 while the car is braked, 2 always; 3 a torque converter's
    lock-up clutch alone is
    machine_nm: (time,) set-point of the Line's first machine while the engine drives
    others_nm: (time, machine - 1) of those beside it; energy_j: (time + 1,) stored energy
    course: of an engine that has a speed of its own, else None
    """

    way: Indices
    engine_on: Flags
    open_while: Indices
    machine_nm: Array
    energy_j: Array
    others_nm: Array
    course: FreeCourse | None = None


def replay_of(trajectory: Trajectory, line: Line) -> ForwardPlan:
    """The plan that a trajectory of a table from `build_problem` has driven."""
    table = trajectory.problem.table
    flows, columns = flows_of(table)
    signals = signals_of(table)
    states = flows.states(columns[trajectory.control])
    free = runs_free(flows.car, states, signals.speed_mps, trajectory.flows["engine_speed_radps"])
    in_gear, open_while = driver_gears(signals, states, free)
    index = cache(line.index)
    way = [index(g, state.gears) for g, state in zip(in_gear.tolist(), states, strict=True)]
    found, course = trajectory.flows, None
    torques = _own(np.stack([found[f"{name}_torque_nm"] for name in flows.machines], axis=1))
    ordered = _own(torques[:, list(line.order)])
    if line.free is not None:
        course = FreeCourse(
            _own(found["engine_speed_radps"]),
            _own(found["engine_torque_nm"]),
            torques,
            np.array([bool(state.closed) for state in states]),
        )
    return ForwardPlan(
        np.array(way, dtype=np.int64),
        np.array([state.engine_on for state in states]),
        open_while,
        _own(ordered[:, 0]),
        _own(trajectory.energy_j),
        _own(ordered[:, 1:]),
        course,
    )


def _own(values: Array) -> Array:
    return np.ascontiguousarray(values, dtype=np.float64)


def flows_of(table: ControlTable) -> tuple[PowerFlows, Indices]:
    """The flows of a table's controls before a dwell repeats them, and which of those each control is."""
    found: Mapping[str, Array] = table.flows
    flows, columns = found, np.arange(len(table.mode))
    if isinstance(found, RepeatedFlows):
        flows, columns = found.flows, found.columns
    if not isinstance(flows, PowerFlows):
        raise DataError("only a plan on a table that build_problem has made can be driven forward")
    return flows, columns


def signals_of(table: ControlTable) -> Signals:
    """The signals of a table that has them."""
    if table.signals is None:
        raise DataError("only a plan on a table that build_problem has made can be driven forward")
    return table.signals


def runs_free(
    car: Architecture, states: Sequence[State], speed_mps: Array, engine_radps: Array
) -> Flags:
    """(time,) where a gear is chosen in which the turbine of a torque converter overruns its impeller.

    Nothing passes there in any gear but the lock-up clutch closed: the car coasts, and a choice of gear is none.
    """
    chosen, part = (
        np.array([state.listed for state in states], dtype=np.int64),
        car.driveline.converter,
    )
    if part is None or car.gearbox is None:
        return np.zeros(len(chosen), dtype=bool)
    turbine = car.gearbox.ratios[chosen] * speed_mps / car.vehicle.tyre_radius_m
    overruns = turbine >= part.data.speed_ratio[-1] * engine_radps
    on = np.array([state.engine_on for state in states])
    locked = part.data.locks(chosen, turbine, car.engine.idle_radps)
    free: Flags = on & (chosen > 0) & (speed_mps > 0) & overruns & ~locked
    return free


def driver_gears(
    signals: Signals, states: Sequence[State] = (), free: Flags | None = None
) -> tuple[Indices, Indices]:
    """(time,) gear that the driver has in, and `open_while` of the clutch.

    states: that chose gears; free: of `runs_free`, where the gear that comes next is in
    """
    listed = np.array([state.listed for state in states]) if states else np.zeros_like(signals.gear)
    gear = np.where(listed > 0, listed, signals.gear)
    moving = signals.speed_mps > 0
    neutral = (gear == 0) & moving
    free = np.zeros_like(moving) if free is None else free
    in_gear = _held(np.where(moving & (gear > 0) & ~free, gear, 0))
    open_while = np.where(neutral, 2, np.where(signals.clutch_open, 1, 0)).astype(np.int64)
    open_while[free] = 3
    return in_gear, open_while


def _held(gear: Indices) -> Indices:
    """Gears in place of 0: at rest the one that comes next, in neutral on the way as well; at the end the last."""
    found = gear.copy()
    following = 0
    for k in range(len(found) - 1, -1, -1):
        following = found[k] = found[k] if found[k] > 0 else following
    last = 1
    for k in range(len(found)):
        last = found[k] = found[k] if found[k] > 0 else last
    return found
