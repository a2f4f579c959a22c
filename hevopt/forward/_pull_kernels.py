"""Full pedal: a launch at a set engine speed, all that engine and machine give, changes up. Compiled."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hevopt._compile import compiled
from hevopt.forward._acting_kernels import LoopCar
from hevopt.forward._contact_kernels import clutch_capacity_nm, pace_of, resistance
from hevopt.forward._lever_kernels import changed, keeping_pace_nm, moves_machine, resting_lever
from hevopt.forward._limits_kernels import at, electric_w
from hevopt.forward._plant_kernels import step
from hevopt.forward._rows_kernels import Array, Inputs, State, row_length, settled_rows, turning
from hevopt.forward._share_kernels import following_nm, machine_range, pace_nm
from hevopt.problem._battery_kernels import chemical_power_at

# Columns of what is recorded after every step.
SPEED, DISTANCE, GEAR, ENERGY, SIDE, FORCE = range(6)
COLUMNS = 6
# How much of the last step's gain in speed an engine is brought ahead of the gears.
_AHEAD = 1.1


class Foot(NamedTuple):
    """How the pedal is floored.

    launch_radps, up_radps: engine speed held in the launch, and of a change up; boosts: whether the machine helps
    lag_s, natural_share: full load comes as  s0 + (1 - s0)(1 - exp(-t / lag))  with the pedal; 0 for at once
    """

    launch_radps: float
    up_radps: float
    boosts: bool
    lag_s: float
    natural_share: float


@compiled()
def _machine_nm(
    car: LoopCar, foot: Foot, side_radps: float, speed: float, energy_j: float
) -> float:
    """The machine's torque: what the load needs of an alternator, all it has where it helps."""
    if len(car.limits.load_nm) > 0:
        return following_nm(side_radps, car.limits)
    if not foot.boosts or energy_j <= car.window_j[0]:
        return 0.0
    return machine_range(speed, car.limits)[1]


@compiled(nogil=True)
def pull(
    car: LoopCar, by_gear: NDArray[np.int64], foot: Foot, start: tuple[float, int, float],
    step_s: float, record: Array,
) -> None:  # fmt: skip
    """Fill the record, (step, column); by_gear: way of every gear; start: speed, place in it, stored energy."""
    pace, rows = pace_of(step_s, car.body.tyre.lag_s), settled_rows(car.ways)
    scratch, machine_nm = np.empty(row_length(car.ways)), np.zeros(1)
    output, radius, limits = len(car.ways.inertia_kgm2) - 1, car.body.radius_m, car.limits
    speed, gear, energy = start
    way, launches, distance = by_gear[gear], speed == 0.0, 0.0
    ratio = car.ways.wheel[way, output]
    side = foot.launch_radps if launches else max(ratio * speed / radius, limits.idle_radps)
    passive, _, along = resistance(speed, 0.0, car.body)
    state = State(speed, 0.0 if launches else passive + along, side, way, way, 0.0, 0)
    lever, closing, gained = resting_lever(way), 0.0 if launches else 1.0, 0.0
    for i in range(len(record)):
        wheel, n = state.speed_mps / radius, state.side_radps
        if n >= foot.up_radps and gear + 1 < len(by_gear) and not launches and closing == 1.0:
            gear, closing = gear + 1, 0.0
        machine = turning(car.ways.wheel, lever.way, lever.from_way, lever.blend, 1) * wheel
        machine += car.ways.side[lever.way, 1] * n
        lever = changed(lever, by_gear[gear], wheel, car.ways, car.fast_way, car.fast_radps, car.shifting,
                        step_s, pace_nm(machine, limits))  # fmt: skip
        ratio = turning(car.ways.wheel, lever.way, lever.from_way, lever.blend, output)
        share = 1.0
        if foot.lag_s > 0.0:
            share -= (1.0 - foot.natural_share) * np.exp(-i * step_s / foot.lag_s)
        most = share * at(limits.full_nm, limits.engine_step, n)
        least = at(limits.least_nm, limits.engine_step, n)
        machine_nm[0] = _machine_nm(car, foot, n, machine, energy)
        if moves_machine(car.ways, lever) and lever.gap_s > 0.0:
            machine_nm[0] = keeping_pace_nm(car.ways, state, lever, wheel, step_s)
        if launches and car.ways.wheel[by_gear[0], output] * wheel >= foot.launch_radps:
            launches, closing = False, 1.0
        # As fast as the gears will be, and no slower: a clutch that is overtaken within a step passes nothing.
        target, capacity = max(ratio * (wheel + gained), limits.idle_radps), 0.0
        rate = 1.0 - np.exp(-step_s / car.driver.governor_s)
        if launches:
            target, rate = foot.launch_radps, 1.0
            capacity = share * at(limits.full_nm, limits.engine_step, foot.launch_radps)
            capacity += car.ways.side[way, 1] * machine_nm[0]
        elif lever.gap_s == 0.0:
            closing = min(closing + step_s / max(car.body.clutch.closing_s, step_s), 1.0)
            rate = 1.0
            capacity = closing * clutch_capacity_nm(n - ratio * wheel, car.body.clutch)
        inputs = Inputs(machine_nm, most, n + rate * (target - n), least, max(most, least), capacity, 0.0,
                        0.0, lever.way, lever.from_way, lever.blend)  # fmt: skip
        before = state.speed_mps
        state, out = step(car.body, car.ways, rows, state, inputs, pace, scratch)
        distance += 0.5 * step_s * (before + state.speed_mps)
        gained = max(_AHEAD * (state.speed_mps - before) / radius, 0.0)
        after = turning(car.ways.wheel, state.way, state.from_way, state.blend, 1)
        after = after * state.speed_mps / radius + car.ways.side[state.way, 1] * state.side_radps
        power = electric_w(machine_nm[0], 0.5 * (machine + after), limits) + limits.auxiliary_w
        energy -= step_s * chemical_power_at(power, energy, car.battery)
        row = record[i]
        row[SPEED], row[DISTANCE], row[GEAR], row[ENERGY] = state.speed_mps, distance, gear, energy
        row[SIDE], row[FORCE] = state.side_radps, out.force_n
