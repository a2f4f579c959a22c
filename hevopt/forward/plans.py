"""What a driver is to do with engine and gears: a plan made backward, replayed."""

from dataclasses import dataclass

import numpy as np

from hevopt.display.facts import Shown
from hevopt.errors import DataError
from hevopt.forward.lines import Line
from hevopt.powertrain.flows import PowerFlows
from hevopt.problem.arrays import Array, Flags, Indices
from hevopt.problem.problem import Trajectory


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class ForwardPlan(Shown):
    """A plan over the steps of a cycle, as the loop follows it.

    way: (time,) index of a Line; engine_on: (time,)
    open_while: (time,) the clutch is open: 0 never, 1 while the car is braked, 2 always
    machine_nm: (time,) set-point of the machine while the engine drives; energy_j: (time + 1,) stored energy
    """

    way: Indices
    engine_on: Flags
    open_while: Indices
    machine_nm: Array
    energy_j: Array


def replay_of(trajectory: Trajectory, line: Line) -> ForwardPlan:
    """The plan that a trajectory of a table from `build_problem` has driven."""
    table = trajectory.problem.table
    flows, signals = table.flows, table.signals
    if not isinstance(flows, PowerFlows) or signals is None:
        raise DataError("only a plan on a table that build_problem has made can be driven forward")
    states = flows.states(trajectory.control)
    listed = np.array([state.listed for state in states])
    gear = np.where(listed > 0, listed, signals.gear)
    moving = signals.speed_mps > 0
    neutral = (gear == 0) & moving
    in_gear = _held(np.where(moving & (gear > 0), gear, 0))
    way = [line.index(int(g), state.gears) for g, state in zip(in_gear, states, strict=True)]
    machine = trajectory.flows[f"{flows.machines[0]}_torque_nm"]
    return ForwardPlan(
        np.array(way, dtype=np.int64),
        np.array([state.engine_on for state in states]),
        np.where(neutral, 2, np.where(signals.clutch_open, 1, 0)).astype(np.int64),
        np.ascontiguousarray(machine, dtype=np.float64),
        np.ascontiguousarray(trajectory.energy_j, dtype=np.float64),
    )


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
