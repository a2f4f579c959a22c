"""Backward powertrain evaluator: (Architecture, Demand) to ControlTable, as array operations.

Signs: power > 0 flows towards the wheels; battery power > 0 discharges; brake power >= 0.

A control is a state of the driveline (engine turning or at rest, gears) and a level of what is free in it
(levels.py). What the step makes of the state is in phases.py, how shafts turn in shafts.py, the balance of their
torques in torques.py, what limits leave of the controls in rejects.py: one engine for every driveline.
"""

import numpy as np

from hevopt.car.architecture import Architecture
from hevopt.car.engine import ELECTRICITY_JPKG
from hevopt.car.storing import storing_kgpj
from hevopt.driving.cycle import Cycle
from hevopt.driving.demand import Demand, demand_of
from hevopt.driving.driver import change_down
from hevopt.errors import DataError, InfeasibleError
from hevopt.powertrain.branches import Branch, branches, deliverable_nm
from hevopt.powertrain.flows import PowerFlows
from hevopt.powertrain.levels import Around
from hevopt.powertrain.modes import modes_of
from hevopt.powertrain.rejects import Bits
from hevopt.powertrain.shortfall import shortfall_message
from hevopt.problem.arrays import Array, Flags
from hevopt.problem.dwell import RepeatedFlows, with_dwell
from hevopt.problem.frozen import frozen
from hevopt.problem.problem import Problem, Trajectory
from hevopt.problem.table import Control, ControlTable, Signals

TORQUE_LEVELS = 41
# Shares of the demand by which a step is lowered, pass by pass, where limits lie between controls: a little, and
# where that is not enough ever more, up to all of it.
_STEPS_DOWN = (0.03, 0.03, 0.03, 0.03, 0.03, 0.06, 0.12, 0.25, 0.5, 1.0)


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
    around: where to add controls, see `around_plan`.
    Raises InfeasibleError, listing steps and missing torque, where no control follows the cycle; with
    `allow_shortfall` such steps are driven with what the powertrain can give, and marked in the table.
    """
    demand = demand_of(cycle, architecture.vehicle, architecture.gearbox)
    gearbox = architecture.gearbox
    if cycle.gear is None and architecture.gear == "cycle" and gearbox is not None:
        demand = change_down(demand, architecture.vehicle, architecture.engine, gearbox)
    table = build_table(
        architecture, demand, levels=levels, allow_shortfall=allow_shortfall, around=around
    )
    problem = Problem(
        table, architecture.battery, architecture.soc_start, architecture.soc_end, 0, nox_weight,
        1 / ELECTRICITY_JPKG if architecture.electric else 0.0,
        architecture.thresholds, storing_kgpj(architecture),
    )  # fmt: skip
    engine = architecture.engine
    return with_dwell(problem, engine.least_on_s, engine.least_off_s)


def build_table(
    architecture: Architecture,
    demand: Demand,
    *,
    levels: int = TORQUE_LEVELS,
    allow_shortfall: bool = False,
    around: Around | None = None,
    apart: bool = False,
) -> ControlTable:
    """Every control at every step, (time, control); apart: no step follows another, see `points_of`."""
    if not 2 <= levels <= 2001:
        raise DataError(f"torque levels {levels}; allowed: 2 to 2001")
    found = branches(architecture, demand, levels, around)
    stuck, missing = stuck_steps(found), np.zeros(len(demand.time_s))
    if stuck.any() and allow_shortfall:
        demand, found, missing = lowered(architecture, demand, found, levels, around)
        stuck = stuck_steps(found)
    if stuck.any():
        lacking = np.zeros_like(missing)
        if not allow_shortfall:
            lacking = _missing_nm(architecture, demand, found, stuck, _STEPS_DOWN[0])
        raise InfeasibleError(
            shortfall_message(architecture, demand, stuck, lacking, _rejects(found))
        )
    return _assemble(architecture, demand, found, missing, apart=apart)


def lowered(
    architecture: Architecture, demand: Demand, found: list[Branch], levels: int, around: Around | None = None
) -> tuple[Demand, list[Branch], Array]:  # fmt: skip
    """The demand with what the powertrain can give at steps without a control, its branches, and what is missing.

    found: the branches of the demand as it is. Where no torque at all helps, a step is left without a control.
    """
    stuck, missing = stuck_steps(found), np.zeros(len(demand.time_s))
    # With less torque a launch is at a lower speed, where a map may cover less again.
    for share in _STEPS_DOWN:
        more = _missing_nm(architecture, demand, found, stuck, share)
        if share > _STEPS_DOWN[0]:
            least = share * np.maximum(demand.wheel_torque_nm, 0.0)
            more = np.where(stuck, np.maximum(more, least), 0.0)
        if not more.any():
            continue
        missing = missing + more
        demand = demand.with_torque(demand.wheel_torque_nm - more)
        found = branches(architecture, demand, levels, around)
        stuck = stuck_steps(found)
        if not stuck.any():
            break
    return demand, found, missing


def around_plan(trajectory: Trajectory, table: ControlTable, share: float) -> Around:
    """Where to add torques, and engine speeds where they are free: close to what a trajectory chooses."""
    flows, control = table.flows, trajectory.control
    if isinstance(flows, RepeatedFlows):
        control = flows.columns[control]
        flows = flows.flows
    if not isinstance(flows, PowerFlows):
        raise DataError("torques are refined around a plan of a table that build_problem has made")
    states = flows.states(control)
    given = flows.given(control)
    torque = np.full(len(states), np.nan)
    for values in given.values():
        torque = np.where(np.isnan(torque), values, torque)
    found = {**given, "speed": trajectory.flows["engine_speed_radps"]}
    torques, points = {}, {}
    for state in dict.fromkeys(states):
        here = np.array([other == state for other in states])
        torques[state] = np.where(here, torque, np.nan)
        points[state] = {name: np.where(here, values, np.nan) for name, values in found.items()}
    return Around(torques, share, points)


def _rejects(found: list[Branch]) -> Bits:
    return np.hstack([branch.reject for branch in found])


def _missing_nm(
    architecture: Architecture, demand: Demand, found: list[Branch], stuck: Flags, share: float
) -> Array:
    """(time,) wheel torque beyond what any state delivers at the steps without a control; else 0.

    share: of the demand, the least of it where controls are gridded
    """
    limits = [deliverable_nm(architecture, branch, stuck) for branch in found]
    short = demand.wheel_torque_nm - np.max(limits, axis=0)
    missing: Array = np.where(stuck, np.maximum(short, 0.0), 0.0)
    if any(branch.points for branch in found):
        least = share * np.maximum(demand.wheel_torque_nm, 0.0)
        missing = np.where(stuck, np.maximum(missing, least), 0.0)
    return missing


def stuck_steps(found: list[Branch]) -> Flags:
    """(time,) steps without a control."""
    drivable: Flags = np.any([(branch.reject == 0).any(axis=1) for branch in found], axis=0)
    return ~drivable


def _assemble(
    architecture: Architecture, demand: Demand, found: list[Branch], missing: Array, *, apart: bool
) -> ControlTable:
    modes = modes_of(architecture, [branch.driven for branch in found], apart=apart)
    controls = tuple(
        Control(
            branch.driven.state.engine_on,
            branch.driven.state.gears[0][1] if branch.driven.state.gears else 0,
            label,
            branch.driven.state.listed,
        )
        for branch in found
        for label in branch.driven.labels
    )

    def whole(name: str) -> Array:
        return frozen(name, np.hstack([getattr(branch, name) for branch in found]))

    return ControlTable(
        time_s=demand.time_s,
        step_s=demand.step_s,
        fuel_kg=whole("fuel_kg"),
        nox_kg=whole("nox_kg"),
        battery_power_w=whole("battery_power_w"),
        reject=_rejects(found),
        mode=np.repeat(modes.mode, [len(branch.driven.labels) for branch in found]),
        switch_fuel_kg=modes.switch_fuel_kg,
        switch_energy_j=modes.switch_energy_j,
        switch_allowed=np.ones(modes.switch_fuel_kg.shape[-2:], dtype=bool),
        controls=controls,
        signals=Signals(demand.speed_mps, demand.wheel_power_w, demand.gear, demand.clutch_open),
        flows=PowerFlows(
            len(demand.time_s),
            tuple(branch.driven for branch in found),
            architecture,
        ),
        missing_torque_nm=missing,
    )
