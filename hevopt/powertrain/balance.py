"""Torque balance of one joint: which machine torques are open, and what engine, clutch and brakes then do.

With S the machine's torque less its inertia, and M what S gives at the wheels on a path of its own:
    gearbox input   T_in = (wheel torque - M) through the gearbox, equations (13) and (14)
    engine          T_e = T_in - [S where it joins the shaft] + J_e dw/dt
With negative demand T_e stops at the drag torque and the brakes take what the shafts do not.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hevopt.car.architecture import Architecture
from hevopt.car.transmission import input_torque_nm, output_torque_nm
from hevopt.display.facts import Shown
from hevopt.driving.demand import Demand
from hevopt.powertrain.joint import Joint

Array = NDArray[np.float64]

_BRAKING_LEVELS = 6
_TORQUE_TOLERANCE_NM = 1e-6
_ADDED_PLACES = np.array([-1.0, -0.5, 0.0, 0.5, 1.0])
_SPECIAL_LEVELS = ("zero torque", "battery idle", "best efficiency", "fuel cut")


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Balance(Shown):
    """Torques in Nm, (time, level).

    machine, engine: at their shafts; clutch: through a slipping or locked clutch
    gearbox_in: at its input; wheel_own: at the wheels through the machine's own path; brake >= 0
    least_engine: (time, 1) lowest torque the engine may have
    """

    machine: Array
    engine: Array
    clutch: Array
    gearbox_in: Array
    machine_net: Array
    wheel_own: Array
    brake: Array
    least_engine: Array


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Around(Shown):
    """Where to add machine torques: close to those of a plan.

    torque_nm: (engine on, machine gear, engine gear) -> (time,) torque of the plan, NaN where it drives another way
    share: distance of the outermost torque added, as a share of what is open at the step
    """

    torque_nm: Mapping[tuple[bool, int, int], Array]
    share: float

    def added_nm(self, joint: Joint, low: Array, high: Array) -> Array:
        """(time, added) machine torques; the lowest open one again where the plan drives another way."""
        key = (joint.engine_on, joint.machine_gear, joint.engine_gear)
        centre = self.torque_nm.get(key, np.full_like(low, np.nan))[:, None]
        added = centre + self.share * (high - low)[:, None] * _ADDED_PLACES
        low, high = np.minimum(low, high)[:, None], np.maximum(low, high)[:, None]
        return np.where(np.isnan(added), low, np.clip(added, low, high))


def machine_torques(
    architecture: Architecture,
    demand: Demand,
    joint: Joint,
    levels: int,
    around: Around | None = None,
) -> tuple[Array, tuple[str, ...], NDArray[np.bool_]]:
    """(time, level) machine torques, their labels, and (time,) whether there is any choice."""
    idle = architecture.machines[0].generating_nm(
        architecture.vehicle.auxiliary_power_w, joint.machine_speed_radps
    )
    idle = np.nan_to_num(idle)
    if architecture.coupling.kind == "none":
        return idle[:, None], ("battery idle",), np.ones(len(idle), dtype=bool)
    low, high = machine_torque_range(architecture, demand, joint)
    spread = high - low > _TORQUE_TOLERANCE_NM
    shares = np.linspace(0.0, 1.0, levels if joint.engine_on else _BRAKING_LEVELS)
    torque = low[:, None] * (1 - shares) + high[:, None] * shares
    labels = tuple(f"{share:.3f}" for share in shares)
    if not joint.engine_on:
        return torque, labels, spread
    best_engine = architecture.engine.best_nm(joint.engine_speed_radps)
    best = machine_torque_at(architecture, demand, joint, best_engine)
    least = least_engine_torque(architecture, joint)
    cut = machine_torque_at(architecture, demand, joint, least)
    cut = np.clip(cut, np.minimum(low, high), np.maximum(low, high))
    torque = np.column_stack([torque, np.zeros_like(idle), idle, best, cut])
    labels = (*labels, *_SPECIAL_LEVELS)
    if around is not None:
        torque = np.column_stack([torque, around.added_nm(joint, low, high)])
        labels = (*labels, *(f"refined {place:+.2f}" for place in _ADDED_PLACES))
    return torque, labels, spread


def machine_torque_range(
    architecture: Architecture, demand: Demand, joint: Joint
) -> tuple[Array, Array]:
    """(time,) lowest and highest machine torque that the limits of engine and machine leave open."""
    machine, speed = architecture.machines[0], joint.machine_speed_radps
    usable = joint.connected & (speed <= machine.speed_max_radps)
    limit = np.where(usable, machine.limit_nm(speed), 0.0)
    apart = machine_torque_at(architecture, demand, joint, np.zeros_like(limit))
    low = high = apart
    if joint.engine_on:
        transmits = joint.locked | joint.slipping
        least = least_engine_torque(architecture, joint)
        full = architecture.engine.covered_nm(joint.engine_speed_radps)
        full = np.where(np.isnan(full), np.maximum(least, 0.0), full)
        low = np.where(transmits, machine_torque_at(architecture, demand, joint, full), apart)
        high = np.where(transmits, machine_torque_at(architecture, demand, joint, least), apart)
        alone = joint.upstream & ~transmits  # the engine drives the machine, nothing else
        low, high = np.where(alone, -full, low), np.where(alone, 0.0, high)
    high = np.where(demand.wheel_torque_nm > 0, high, np.maximum(high, 0.0))
    return np.clip(low, -limit, limit), np.clip(high, -limit, limit)


def least_engine_torque(architecture: Architecture, joint: Joint) -> Array:
    """(time,) drag torque where the clutch is locked (fuel cut); else 0, the engine keeps itself turning.

    0 too at speeds beyond a measured map's, where no torque of the engine is used.
    """
    drag = architecture.engine.drag_nm(joint.engine_speed_radps)
    return np.where(joint.locked & ~np.isnan(drag), drag, 0.0)


def machine_torque_at(
    architecture: Architecture, demand: Demand, joint: Joint, engine_nm: Array
) -> Array:
    """(time,) machine torque that meets the demand together with an engine torque."""
    from_engine = engine_nm - architecture.engine.inertia_kgm2 * joint.engine_accel_radps2
    wanted, ratio, efficiency = demand.wheel_torque_nm, joint.gear_ratio, joint.gear_efficiency
    joined = input_torque_nm(wanted, ratio, efficiency) - from_engine
    rest = wanted - output_torque_nm(from_engine, ratio, efficiency)
    own = input_torque_nm(rest, joint.machine_ratio, joint.machine_efficiency)
    inertia = architecture.machines[0].inertia_kgm2 * joint.machine_accel_radps2
    return np.where(joint.upstream | joint.shared, joined, own) + inertia


def balance(architecture: Architecture, demand: Demand, joint: Joint, machine_nm: Array) -> Balance:
    """All torques for (time, level) machine torques; brakes negative where the demand is not met."""
    wanted = _column(demand.wheel_torque_nm)
    ratio, efficiency = _column(joint.gear_ratio), _column(joint.gear_efficiency)
    transmits = _column(joint.locked | joint.slipping)
    upstream, shared = _column(joint.upstream), _column(joint.shared)
    least = _column(least_engine_torque(architecture, joint))

    machine_accel = _column(joint.machine_accel_radps2)
    net = machine_nm - architecture.machines[0].inertia_kgm2 * machine_accel
    own_ratio, own_efficiency = _column(joint.machine_ratio), _column(joint.machine_efficiency)
    own = output_torque_nm(net, own_ratio, own_efficiency)
    own = np.where(upstream | shared, 0.0, own)
    inertia = architecture.engine.inertia_kgm2 * _column(joint.engine_accel_radps2)

    engine = np.zeros_like(machine_nm)
    if joint.engine_on:
        needed = input_torque_nm(wanted - own, ratio, efficiency) + inertia
        needed = needed - np.where(upstream | shared, net, 0.0)
        needed = np.where(wanted > 0, needed, np.maximum(needed, least))
        engine = np.where(transmits, needed, np.where(upstream, -machine_nm, 0.0))
    clutch = np.where(transmits, engine - inertia + np.where(upstream, net, 0.0), 0.0)
    gearbox_in = clutch + np.where(shared, net, 0.0)
    brake = output_torque_nm(gearbox_in, ratio, efficiency) + own - wanted
    return Balance(machine_nm, engine, clutch, gearbox_in, net, own, brake, least)


def deliverable_nm(architecture: Architecture, demand: Demand, joint: Joint) -> Array:
    """(time,) largest wheel torque of the joint, machine at its limit, engine at full load or its map's end."""
    machine, speed = architecture.machines[0], joint.machine_speed_radps
    motoring = architecture.functions & {"e_boost", "nox_cut", "power_management"}
    usable = joint.connected & (speed <= machine.speed_max_radps) & bool(motoring)
    top = np.where(usable, machine.limit_nm(speed), 0.0)
    if architecture.coupling.kind == "none":
        top = np.nan_to_num(machine.generating_nm(architecture.vehicle.auxiliary_power_w, speed))
    net = top - machine.inertia_kgm2 * joint.machine_accel_radps2
    covered = architecture.engine.covered_nm(joint.engine_speed_radps)
    full = covered - architecture.engine.inertia_kgm2 * joint.engine_accel_radps2
    transmits = (joint.locked | joint.slipping) & joint.engine_on & ~np.isnan(covered)
    transmits &= joint.engine_speed_radps <= architecture.engine.speed_max_radps
    joins = joint.shared | (joint.upstream & transmits)
    shaft = np.where(transmits, full, 0.0) + np.where(joins, net, 0.0)
    own = output_torque_nm(net, joint.machine_ratio, joint.machine_efficiency)
    own = np.where(joint.upstream | joint.shared, 0.0, own)
    total = output_torque_nm(shaft, joint.gear_ratio, joint.gear_efficiency) + own
    return np.where(joint.possible, total, 0.0)


def _column(values: NDArray[Any]) -> NDArray[Any]:
    return values[:, None]
