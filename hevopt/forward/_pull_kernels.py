"""Full pedal: a launch at a set engine speed, all that engine and machine give, changes up. Compiled."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hevopt._compile import compiled
from hevopt.forward import _rows_kernels as col
from hevopt.forward._acting_kernels import LoopCar
from hevopt.forward._beside_kernels import beside_w, floor_beside
from hevopt.forward._contact_kernels import (
    Pace,
    clutch_capacity_nm,
    grip_n,
    pace_of,
    resistance,
    wheel_radps,
)
from hevopt.forward._fluid_kernels import may_lock
from hevopt.forward._lever_kernels import (
    Lever,
    changed,
    keeping_pace_nm,
    moves_machine,
    resting_lever,
)
from hevopt.forward._limits_kernels import Gives, at, by_map, electric_w, terminal_w
from hevopt.forward._plant_kernels import step
from hevopt.forward._rows_kernels import Array, Inputs, State, row_length, settled_rows, turning
from hevopt.forward._share_kernels import following_nm, machine_range, pace_nm
from hevopt.problem._battery_kernels import chemical_power_at

# Columns of what is recorded after every step.
SPEED, DISTANCE, GEAR, ENERGY, SIDE, FORCE, MACHINE = range(7)
COLUMNS = 7
# How much of the last step's gain in speed an engine is brought ahead of the gears.
_AHEAD = 1.1
# Share of their peak that a launch leaves to tyres that slip [E].
_HELD_SHARE = 0.95


class Foot(NamedTuple):
    """How the pedal is floored.

    launch_radps, up_radps: engine speed held in the launch, and of a change up at the latest
    up_mps: (gear,) speed of the car of a change up; boosts: whether the machine helps
    fills: whether it adds no more than what the engine lacks of its steady full load
    lag_s, natural_share: full load comes as  s0 + (1 - s0)(1 - exp(-t / lag))  with the pedal; 0 for at once
    """

    launch_radps: float
    up_radps: float
    up_mps: Array
    boosts: bool
    fills: bool
    lag_s: float
    natural_share: float


class Pull(NamedTuple):
    """The car at full pedal between two steps.

    gear: place in the gears; closing: of the clutch, from 0 to 1; gained_radps: by the wheels in the last step
    """

    state: State
    lever: Lever
    gear: int
    launches: bool
    closing: float
    gained_radps: float
    distance_m: float
    energy_j: float


class PullWork(NamedTuple):
    """What the loop works with: settled_rows of the ways, space for a row of a moving one, and for torques."""

    rows: Array
    moving: Array
    machine_nm: Array


@compiled()
def pull_work(car: LoopCar) -> PullWork:
    """Room for the loop's work."""
    machines = len(car.ways.inertia_kgm2) - 2
    return PullWork(settled_rows(car.ways), np.empty(row_length(car.ways)), np.zeros(machines))


@compiled(bare=True)
def pull_begun(
    car: LoopCar, by_gear: NDArray[np.int64], foot: Foot, start: tuple[float, int, float]
) -> Pull:  # fmt: skip
    """The car before its first step; start: speed, place of the gear, stored energy."""
    speed, gear, energy = start
    way, flows = by_gear[gear], len(car.ways.fluid.locks) > 0
    launches = speed == 0.0 and not flows
    ratio = car.ways.wheel[way, len(car.ways.inertia_kgm2) - 1]
    turns = max(ratio * speed / car.body.radius_m, car.limits.idle_radps)
    passive, _, along = resistance(speed, 0.0, car.body)
    state = State(speed, 0.0 if launches else passive + along, foot.launch_radps if launches else turns,
                  way, way, 0.0, 0, 0.0, 0.0, 0.0)  # fmt: skip
    lever = resting_lever(way)
    closed = may_lock(car.ways.fluid, lever, turns) if flows else not launches
    return Pull(state, lever, gear, launches, 1.0 if closed else 0.0, 0.0, 0.0, energy)


@compiled(bare=True)
def _lacking_nm(row: Array, missing_nm: float) -> float:
    """The machine's torque that does at the wheels what one of the engine would."""
    clutch = row[col.CLUTCH]
    engine = row[col.ENGINE] + clutch * row[col.SIDE_ENGINE]
    machine = row[col.MACHINES] + clutch * row[col.MACHINES + 1]
    return float(engine * missing_nm / machine) if machine > 0.0 else 0.0


@compiled(bare=True)
def _machine_nm(
    car: LoopCar, foot: Foot, pull: Pull, way_row: Array, speed: float, most_nm: float
) -> float:
    """The machine's torque: what the load needs of an alternator, all it has or what is lacking where it helps."""
    side = pull.state.side_radps
    if len(car.limits.load_nm) > 0:
        return following_nm(side, car.limits.auxiliary_w, car.limits)
    if not foot.boosts or pull.energy_j <= car.window_j[0]:
        return 0.0
    high = machine_range(speed, car.limits)[1]
    if not foot.fills:
        return high
    full = at(car.limits.full_nm, car.limits.engine_step, side)
    return min(max(_lacking_nm(way_row, full - most_nm), 0.0), high)


@compiled(bare=True)
def _held_nm(car: LoopCar, row: Array, speed_mps: float) -> float:
    """Torque of the clutch that a launch passes on tyres that slip: with more the wheels would spin up."""
    passive, _, along = resistance(speed_mps, 0.0, car.body)
    held_nm = _HELD_SHARE * grip_n(passive + along, 0.0, car.body) * car.body.radius_m
    return float(held_nm / row[col.CLUTCH])


@compiled(inline="always")
def after_pull(
    car: LoopCar, by_gear: NDArray[np.int64], foot: Foot, work: PullWork, pull: Pull, gives: Gives,
    launch_nm: float, pace: Pace, row: Array,
) -> tuple[Pull, float]:  # fmt: skip
    """The car after a step, and the engine's torque in it; launch_nm: what it can give at launch speed."""
    step_s, machine_nm, limits, radius = pace.step_s, work.machine_nm, car.limits, car.body.radius_m
    state, lever, gear, launches, closing, gained, distance, energy = pull
    output, way = len(car.ways.inertia_kgm2) - 1, by_gear[0]
    wheel, n = wheel_radps(state.speed_mps, state.spin_radps, car.body), state.side_radps
    flows = len(car.ways.fluid.locks) > 0
    ready = lever.blend == 0.0 if flows else closing == 1.0 and not launches
    # A clutch that closes may still slip, so that the gears' speed decides; before a torque converter the engine's.
    turns = n if flows else car.ways.wheel[by_gear[gear], output] * wheel
    fast = turns >= foot.up_radps or state.speed_mps >= foot.up_mps[gear]
    if fast and gear + 1 < len(by_gear) and ready:
        gear, closing = gear + 1, 0.0
    machine = turning(car.ways.wheel, lever.way, lever.from_way, lever.blend, 1) * wheel
    machine += car.ways.side[lever.way, 1] * n
    lever = changed(lever, by_gear[gear], state.speed_mps / radius, car.ways, car.fast_way, car.fast_radps,
                    car.shifting, step_s, pace_nm(machine, limits))  # fmt: skip
    ratio = turning(car.ways.wheel, lever.way, lever.from_way, lever.blend, output)
    machine_nm[0] = _machine_nm(car, foot, pull, work.rows[lever.way, 0], machine, gives.most_nm)
    if foot.fills and lever.gap_s > 0.0:
        machine_nm[0] = 0.0
    if moves_machine(car.ways, lever) and lever.gap_s > 0.0:
        machine_nm[0] = keeping_pace_nm(car.ways, state, lever, wheel, step_s)
    on_side = car.ways.side[way, 1] * machine_nm[0]
    if len(machine_nm) > 1:
        helps = foot.boosts and not foot.fills and energy > car.window_j[0]
        floor_beside(car.beside, car.ways, lever, wheel, n, limits, helps, machine_nm)
        for m in range(1, len(machine_nm)):
            on_side += car.ways.side[way, m + 1] * machine_nm[m]
    if launches and car.ways.wheel[by_gear[0], output] * wheel >= foot.launch_radps:
        launches, closing = False, 1.0
    # As fast as the gears will be, and no slower: a clutch that is overtaken within a step passes nothing.
    target, capacity = max(ratio * (wheel + gained), limits.idle_radps), 0.0
    rate = 1.0 - np.exp(-step_s / car.driver.governor_s)
    if launches:
        target, rate = foot.launch_radps, 1.0
        capacity = launch_nm + on_side
        if car.body.tyre.slips:
            capacity = min(capacity, _held_nm(car, work.rows[way, 0], state.speed_mps))
    elif flows:
        # The lock-up clutch slows the engine as far as that is too fast, at full load.
        locks = may_lock(car.ways.fluid, lever, ratio * wheel)
        closing = (
            min(closing + step_s / max(car.body.clutch.closing_s, step_s), 1.0) if locks else 0.0
        )
        target, rate = limits.engine_max_radps, 1.0
        capacity = closing * clutch_capacity_nm(n - ratio * wheel, car.body.clutch)
    elif lever.gap_s == 0.0:
        closing = min(closing + step_s / max(car.body.clutch.closing_s, step_s), 1.0)
        rate = 1.0
        capacity = closing * clutch_capacity_nm(n - ratio * wheel, car.body.clutch)
    inputs = Inputs(machine_nm, gives.most_nm, n + rate * (target - n), gives.least_nm,
                    max(gives.most_nm, gives.least_nm), capacity, 0.0, 0.0, lever.way, lever.from_way,
                    lever.blend, flows and lever.gap_s == 0.0)  # fmt: skip
    before = state.speed_mps
    state, out = step(car.body, car.ways, work.rows, state, inputs, pace, work.moving)
    distance += 0.5 * step_s * (before + state.speed_mps)
    spun = wheel_radps(state.speed_mps, state.spin_radps, car.body) - wheel
    gained = spun if car.body.tyre.slips else (state.speed_mps - before) / radius
    gained = max(_AHEAD * gained, 0.0)
    rate = turning(car.ways.wheel, state.way, state.from_way, state.blend, 1)
    after = rate * state.speed_mps / radius + rate * state.spin_radps
    after += car.ways.side[state.way, 1] * state.side_radps
    power = electric_w(machine_nm[0], 0.5 * (machine + after), limits) + limits.auxiliary_w
    if len(machine_nm) > 1:
        power += beside_w(car.beside, car.ways, lever, wheel + 0.5 * spun, 0.5 * (n + state.side_radps),
                          machine_nm)  # fmt: skip
    energy -= step_s * chemical_power_at(terminal_w(power, limits), energy, car.battery)
    row[SPEED], row[DISTANCE], row[GEAR], row[ENERGY] = state.speed_mps, distance, gear, energy
    row[SIDE], row[FORCE], row[MACHINE] = state.side_radps, out.force_n, machine_nm[0]
    return Pull(state, lever, gear, launches, closing, gained, distance, energy), out.engine_nm


@compiled(bare=True, nogil=True)
def pull(
    car: LoopCar, by_gear: NDArray[np.int64], foot: Foot, work: PullWork, start: tuple[float, int, float],
    step_s: float, record: Array,
) -> None:  # fmt: skip
    """Fill the record, (step, column); by_gear: way of every gear; start: as of pull_begun."""
    pace, limits = pace_of(step_s, car.body.tyre.lag_s), car.limits
    moved = pull_begun(car, by_gear, foot, start)
    for i in range(len(record)):
        share = 1.0
        if foot.lag_s > 0.0:
            share -= (1.0 - foot.natural_share) * np.exp(-i * step_s / foot.lag_s)
        least, full = by_map(moved.state.side_radps, limits)
        launch_nm = share * at(limits.full_nm, limits.engine_step, foot.launch_radps)
        gives = Gives(least, share * full)
        moved, _ = after_pull(car, by_gear, foot, work, moved, gives, launch_nm, pace, record[i])
