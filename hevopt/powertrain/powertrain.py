"""Backward powertrain evaluator: (Architecture, Demand) to ControlTable, as array operations.

Signs: power > 0 flows towards the wheels; battery power > 0 discharges; brake power >= 0.

A control is a joint (couplings.py) and a machine torque. Per step the machine torque runs between what the
engine's limits and the machine's leave, and the engine delivers the rest; with negative demand the friction
brakes take what the shafts do not. Always among the levels: both ends (engine at full load and at its lowest
torque), zero torque, battery idle, engine at its best efficiency, and fuel cut without friction brakes.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hevopt.car.architecture import Architecture
from hevopt.driving.cycle import Cycle
from hevopt.driving.demand import Demand, demand_of
from hevopt.driving.driver import change_down
from hevopt.errors import DataError, InfeasibleError
from hevopt.powertrain.balance import Around, Balance, balance, deliverable_nm, machine_torques
from hevopt.powertrain.couplings import joints
from hevopt.powertrain.flows import PowerFlows, Way
from hevopt.powertrain.joint import Joint
from hevopt.powertrain.rejects import bits, function_rejects, limit_rejects
from hevopt.powertrain.shortfall import shortfall_message
from hevopt.problem import battery as battery_model
from hevopt.problem.frozen import frozen
from hevopt.problem.problem import Problem, Trajectory
from hevopt.problem.table import Control, ControlTable, Reject, Signals

Array = NDArray[np.float64]
Bits = NDArray[np.uint16]

TORQUE_LEVELS = 41
_ROUNDING_W = 1e-9
_SHORTFALL_PASSES = 5


@dataclass(frozen=True, slots=True, eq=False)
class _Branch:
    """All controls of one joint; arrays (time, level)."""

    joint: Joint
    labels: tuple[str, ...]
    machine_nm: Array
    fuel_kg: Array
    nox_kg: Array
    battery_power_w: Array
    reject: Bits


def build_problem(
    architecture: Architecture,
    cycle: Cycle,
    *,
    levels: int = TORQUE_LEVELS,
    nox_weight: float = 0.0,
    allow_shortfall: bool = False,
    around: Around | None = None,
) -> Problem:
    """The energy-management problem of a car on a cycle, charge at the end no less than the car's `soc_end`.

    levels: machine torques per step and joint; nox_weight: kg of fuel that a kg of NOx counts;
    around: where to add torques with the engine on, see `torques_of`.
    Raises InfeasibleError, listing steps and missing torque, where no control follows the cycle; with
    `allow_shortfall` such steps are driven with what the powertrain can give, and marked in the table.
    """
    demand = demand_of(cycle, architecture.vehicle, architecture.gearbox)
    if cycle.gear is None and architecture.gear == "cycle":
        demand = change_down(
            demand, architecture.vehicle, architecture.engine, architecture.gearbox
        )
    table = build_table(
        architecture, demand, levels=levels, allow_shortfall=allow_shortfall, around=around
    )
    return Problem(
        table, architecture.battery, architecture.soc_start, architecture.soc_end, 0, nox_weight
    )


def build_table(
    architecture: Architecture,
    demand: Demand,
    *,
    levels: int = TORQUE_LEVELS,
    allow_shortfall: bool = False,
    around: Around | None = None,
) -> ControlTable:
    """Every control at every step, (time, control)."""
    if not 2 <= levels <= 2001:
        raise DataError(f"torque levels {levels}; allowed: 2 to 2001")
    branches = _branches(architecture, demand, levels, around)
    stuck = _stuck(branches)
    missing = np.zeros(len(demand.time_s))
    if stuck.any():
        missing = _missing_nm(architecture, demand, branches, stuck)
        if allow_shortfall:
            more = missing
            # With less torque a launch is at a lower speed, where a map may cover less again.
            for _ in range(_SHORTFALL_PASSES):
                demand = demand.with_torque(demand.wheel_torque_nm - more)
                branches = _branches(architecture, demand, levels, around)
                stuck = _stuck(branches)
                more = _missing_nm(architecture, demand, branches, stuck)
                if not more.any():
                    break
                missing = missing + more
        if stuck.any():
            missing = np.zeros_like(missing) if allow_shortfall else missing
            raise InfeasibleError(
                shortfall_message(architecture, demand, stuck, missing, _rejects(branches))
            )
    return _assemble(architecture, demand, branches, missing)


def torques_of(trajectory: Trajectory, table: ControlTable) -> dict[tuple[bool, int, int], Array]:
    """(engine on, machine gear, engine gear) -> (time,) machine torque of a trajectory, NaN elsewhere."""
    ways = [
        (label.engine_on, label.machine_gear, label.engine_gear)
        for label in (table.controls[c] for c in trajectory.control)
    ]
    torque = trajectory.flows["machine_torque_nm"]
    return {
        way: np.where([other == way for other in ways], torque, np.nan)
        for way in dict.fromkeys(ways)
    }


def _branches(
    architecture: Architecture, demand: Demand, levels: int, around: Around | None
) -> list[_Branch]:
    branches = []
    may_stop = architecture.functions & {"start_stop", "power_management"}
    for joint in joints(architecture, demand):
        if joint.engine_on or may_stop:
            torque, labels, spread = machine_torques(architecture, demand, joint, levels, around)
            torques = balance(architecture, demand, joint, torque)
            branch = _branch(architecture, demand, joint, torques, labels)
            branch.reject[~spread, 1:] |= np.uint16(Reject.DUPLICATE)
            branches.append(branch)
    return branches


def _rejects(branches: list[_Branch]) -> Bits:
    return np.hstack([branch.reject for branch in branches])


def _missing_nm(
    architecture: Architecture, demand: Demand, branches: list[_Branch], stuck: NDArray[np.bool_]
) -> Array:
    """(time,) wheel torque beyond what any joint delivers at the steps without a control; else 0."""
    limits = [deliverable_nm(architecture, demand, branch.joint) for branch in branches]
    short = demand.wheel_torque_nm - np.max(limits, axis=0)
    missing: Array = np.where(stuck, np.maximum(short, 0.0), 0.0)
    return missing


def _stuck(branches: list[_Branch]) -> NDArray[np.bool_]:
    return ~np.any([(branch.reject == 0).any(axis=1) for branch in branches], axis=0)


def _branch(
    architecture: Architecture,
    demand: Demand,
    joint: Joint,
    torques: Balance,
    labels: tuple[str, ...],
) -> _Branch:
    engine, step_s = architecture.engine, demand.step_s[:, None]
    fuel_kgps = nox_kgps = np.zeros_like(torques.machine)
    if joint.engine_on:
        speed = joint.engine_speed_radps[:, None]
        fuel_kgps = engine.fuel_kgps(torques.engine, speed)
        nox_kgps = engine.nox_kgps(torques.engine, speed)
        nox_kgps = np.where(fuel_kgps == 0, 0.0, nox_kgps)
    off_map = np.isnan(fuel_kgps) | np.isnan(nox_kgps)
    fuel_kgps, nox_kgps = np.nan_to_num(fuel_kgps), np.nan_to_num(nox_kgps)
    loss_w = architecture.machines[0].loss_w(torques.machine, joint.machine_speed_radps[:, None])
    electric_w = torques.machine * joint.machine_speed_radps[:, None] + np.nan_to_num(loss_w)
    battery_power_w = electric_w + architecture.vehicle.auxiliary_power_w
    # What an alternator that follows its load leaves to the battery is rounding, not charge.
    battery_power_w = np.where(np.abs(battery_power_w) < _ROUNDING_W, 0.0, battery_power_w)
    reject = (
        bits(Reject.ENGINE_MAP, off_map)
        | bits(Reject.MACHINE_MAP, np.isnan(loss_w))
        | limit_rejects(architecture, demand, joint, torques)
        | bits(
            Reject.BATTERY_LIMIT,
            ~battery_model.within_limits(architecture.battery, battery_power_w),
        )
        | function_rejects(architecture, demand, joint, torques, battery_power_w)
    )
    fuel_kg, nox_kg = fuel_kgps * step_s, nox_kgps * step_s
    return _Branch(joint, labels, torques.machine, fuel_kg, nox_kg, battery_power_w, reject)


def _assemble(
    architecture: Architecture, demand: Demand, branches: list[_Branch], missing: Array
) -> ControlTable:
    modes, switch_fuel_kg = _modes(architecture, branches)
    widths = [len(branch.labels) for branch in branches]
    ways = [Way(branch.joint, frozen("torque", branch.machine_nm)) for branch in branches]
    controls = tuple(
        Control(branch.joint.engine_on, branch.joint.machine_gear, label, branch.joint.engine_gear)
        for branch in branches
        for label in branch.labels
    )
    return ControlTable(
        time_s=demand.time_s,
        step_s=demand.step_s,
        fuel_kg=frozen("fuel_kg", np.hstack([branch.fuel_kg for branch in branches])),
        nox_kg=frozen("nox_kg", np.hstack([branch.nox_kg for branch in branches])),
        battery_power_w=frozen(
            "battery_power_w", np.hstack([branch.battery_power_w for branch in branches])
        ),
        reject=_rejects(branches),
        mode=np.repeat(modes, widths),
        switch_fuel_kg=switch_fuel_kg,
        switch_allowed=np.ones(switch_fuel_kg.shape, dtype=bool),
        controls=controls,
        signals=Signals(demand.speed_mps, demand.wheel_power_w, demand.gear, demand.clutch_open),
        flows=PowerFlows(architecture, demand, tuple(ways)),
        missing_torque_nm=missing,
    )


def _modes(architecture: Architecture, branches: list[_Branch]) -> tuple[NDArray[np.int64], Array]:
    """Mode of every branch, and the fuel of going from one mode to another, (mode, mode).

    Gears are modes of their own only where changing them costs something.
    """
    machine_kg = architecture.coupling.machine_shift_fuel_kg
    engine_kg = architecture.gearbox.shift_fuel_kg or 0.0
    keys = [
        (
            branch.joint.engine_on,
            branch.joint.machine_gear if machine_kg else 0,
            branch.joint.engine_gear if engine_kg else 0,
        )
        for branch in branches
    ]
    distinct = list(dict.fromkeys(keys))
    switch = np.zeros((len(distinct), len(distinct)))
    for i, (was_on, machine_from, engine_from) in enumerate(distinct):
        for j, (is_on, machine_to, engine_to) in enumerate(distinct):
            start = architecture.engine.start_fuel_kg if is_on and not was_on else 0.0
            changed = engine_from != engine_to and engine_from > 0 and engine_to > 0
            switch[i, j] = (
                start
                + (machine_kg if machine_from != machine_to else 0.0)
                + (engine_kg if changed else 0.0)
            )
    return np.array([distinct.index(key) for key in keys]), switch
