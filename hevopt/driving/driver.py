"""What the driver does where the engine alone lacks torque: changes down, or slips the clutch at higher speed.

Both depend on the engine alone, so that every architecture drives the same gears. Listed gears are kept.
"""

import numpy as np
from numpy.typing import NDArray

from hevopt.car.engine import Engine
from hevopt.car.transmission import Gearbox
from hevopt.car.vehicle import Vehicle
from hevopt.driving.demand import Demand

Array = NDArray[np.float64]
# Changing down stops here, short of the engine's highest speed.
_SPEED_SHARE_MAX = 0.9
# The electric load counts at the crankshaft through an alternator no better than this.
_ALTERNATOR_EFFICIENCY_MIN = 0.5
# Of a step shorter than the gap so much is without torque.
_GAP_SHARE_MAX = 0.8
# What the engine must give beside, for the electric load.
_NEED_MARGIN = 1.1
# So that a need beside an engine without torque is without measure, not without value.
_LEAST_NM = 1e-9


def change_down(demand: Demand, vehicle: Vehicle, engine: Engine, gearbox: Gearbox) -> Demand:
    """The demand in lower gears at the steps where the engine could not hold the listed gear."""
    gear = demand.gear.copy()
    for _ in range(len(gearbox.ratios) - 2):
        speed, need = _engine_speed_and_need(demand, gear, engine, gearbox)
        need = need + _load_w(demand, vehicle) / _ALTERNATOR_EFFICIENCY_MIN / speed
        short = (gear > 1) & (need > engine.full_load_nm(speed))
        lower = np.maximum(gear - 1, 1)
        lower_speed = gearbox.ratios[lower] * demand.wheel_speed_radps
        short &= lower_speed <= _SPEED_SHARE_MAX * engine.speed_max_radps
        if not short.any():
            break
        gear = np.where(short, lower, gear)
    return demand.with_gear(gear)


def launch_speed_radps(demand: Demand, engine: Engine, gearbox: Gearbox) -> Array:
    """(time,) lowest engine speed, idle or above, at which first gear's clutch can pass the demand.

    Idle unless a hard launch needs more torque than full load at idle speed gives; 10 % are kept for the
    electric load.
    """
    _, need = _engine_speed_and_need(demand, demand.gear, engine, gearbox)
    rising = engine.full_load_speed_radps[: int(np.argmax(engine.full_load_torque_nm)) + 1]
    torque = np.maximum.accumulate(engine.full_load_torque_nm[: len(rising)])
    needed = (
        np.interp(_NEED_MARGIN * need, torque, rising) if len(rising) > 1 else np.zeros_like(need)
    )
    launching = (demand.gear == 1) & (demand.wheel_torque_nm > 0)
    return np.where(launching, np.maximum(needed, engine.idle_radps), engine.idle_radps)


def gap_shares(demand: Demand, vehicle: Vehicle, engine: Engine, gearbox: Gearbox) -> Array:
    """(time,) share of the step without torque through the gearbox: at a change of gear while driving.

    What is not driven meanwhile is made up for in the rest of the step. A driver from whom that asks more than the
    engine's full load, or than its map covers, changes faster.
    """
    before = np.concatenate([demand.gear[:1], demand.gear[:-1]])
    still = demand.wheel_speed_radps == 0
    changed = (demand.gear != before) & (demand.gear > 0) & (before > 0) & ~still
    changed[1:] &= ~still[:-1]
    speed, need = _engine_speed_and_need(demand, demand.gear, engine, gearbox)
    need = np.maximum(need, 0.0) + _load_w(demand, vehicle) / _ALTERNATOR_EFFICIENCY_MIN / speed
    most = np.nan_to_num(engine.covered_nm(speed))
    spare = 1 - _NEED_MARGIN * need / np.maximum(most, _LEAST_NM)
    share = np.minimum(gearbox.shift_gap_s / demand.step_s, _GAP_SHARE_MAX)
    return np.where(changed, np.clip(share, 0.0, np.maximum(spare, 0.0)), 0.0)


def launches_at_idle(
    demand: Demand, engine: Engine, slow: Gearbox, fast: Gearbox
) -> NDArray[np.bool_]:
    """(time,) whether first gear's clutch passes the demand at idle speed with every final drive between two.

    slow, fast: the gearbox with the lowest and the highest final drive
    """
    need = _most_need_nm(demand, engine, slow, fast)
    launching = (demand.gear == 1) & (demand.wheel_torque_nm > 0)
    idle_nm = float(engine.full_load_nm(np.array(engine.idle_radps)))
    holds: NDArray[np.bool_] = ~launching | (_NEED_MARGIN * need <= idle_nm)
    return holds


def least_gap_shares(
    demand: Demand, vehicle: Vehicle, engine: Engine, slow: Gearbox, fast: Gearbox
) -> Array:
    """(time,) no more than `gap_shares` with any final drive between two; 0 where that is not known.

    slow, fast: the gearbox with the lowest and the highest final drive
    """
    gap = np.minimum(*(gap_shares(demand, vehicle, engine, box) for box in (slow, fast)))
    low, high = (
        np.maximum(box.ratios[demand.gear] * demand.wheel_speed_radps, engine.idle_radps)
        for box in (slow, fast)
    )
    need = _most_need_nm(demand, engine, slow, fast)
    need = need + _load_w(demand, vehicle) / _ALTERNATOR_EFFICIENCY_MIN / low
    most = np.minimum(engine.covered_nm(low), engine.covered_nm(high))
    for speed in engine.full_load_speed_radps:
        inside = (low < speed) & (speed < high)
        most = np.where(inside, np.minimum(most, engine.covered_nm(speed)), most)
    spare = 1 - _NEED_MARGIN * need / np.maximum(np.nan_to_num(most), _LEAST_NM)
    share = np.minimum(slow.shift_gap_s / demand.step_s, _GAP_SHARE_MAX)
    return np.where(spare >= share, gap, 0.0)


def _most_need_nm(demand: Demand, engine: Engine, slow: Gearbox, fast: Gearbox) -> Array:
    """(time,) no less than the engine must give alone with any final drive between two, 0 or more."""
    gear = demand.gear
    drive = slow.needed_nm(
        gear, slow.ratios[gear] * demand.wheel_speed_radps, demand.wheel_torque_nm
    )
    inertia = engine.inertia_kgm2 * fast.ratios[gear] * demand.wheel_accel_radps2
    need: Array = np.where(gear > 0, np.maximum(drive, 0.0) + np.maximum(inertia, 0.0), 0.0)
    return need


def _load_w(demand: Demand, vehicle: Vehicle) -> Array | float:
    return vehicle.auxiliary_power_w if demand.auxiliary_w is None else demand.auxiliary_w


def _engine_speed_and_need(
    demand: Demand, gear: NDArray[np.int64], engine: Engine, gearbox: Gearbox
) -> tuple[Array, Array]:
    """(time,) engine speed and the torque it must give alone, in a gear; 0 torque in neutral."""
    ratio = gearbox.ratios[gear]
    input_speed = ratio * demand.wheel_speed_radps
    inertia = np.where(
        input_speed >= engine.idle_radps, engine.inertia_kgm2 * ratio * demand.wheel_accel_radps2, 0
    )
    need = gearbox.needed_nm(gear, input_speed, demand.wheel_torque_nm) + inertia
    return np.maximum(input_speed, engine.idle_radps), np.where(gear > 0, need, 0.0)
