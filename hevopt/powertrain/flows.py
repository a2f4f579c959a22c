"""Powers, speeds and torques of a powertrain's controls, worked out where they are asked for.

Of every control they would take ten times the memory of all that a strategy reads; a plan has one control per step.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hevopt.car.architecture import Architecture
from hevopt.car.transmission import output_torque_nm
from hevopt.display.facts import Shown
from hevopt.driving.demand import Demand
from hevopt.powertrain.balance import Balance, balance
from hevopt.powertrain.joint import Joint
from hevopt.problem.flows import Flows

Array = NDArray[np.float64]
_NAMES = (
    "engine_torque_nm", "engine_speed_radps", "machine_torque_nm", "machine_speed_radps", "fuel_power_w",
    "engine_loss_w", "engine_inertia_w", "machine_electric_w", "machine_loss_w", "machine_inertia_w",
    "machine_upstream", "machine_shared", "clutch_in_w", "clutch_loss_w", "gearbox_out_w", "gearbox_loss_w",
    "machine_gear_out_w", "machine_gear_loss_w", "brake_power_w", "wheel_power_w", "auxiliary_power_w",
)  # fmt: skip


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Way(Shown):
    """A joint, and the (time, level) machine torques of its controls."""

    joint: Joint
    machine_nm: Array


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class PowerFlows(Flows):
    """Of the controls of all ways, those of the first way first."""

    architecture: Architecture
    demand: Demand
    ways: tuple[Way, ...]

    def __getitem__(self, name: str) -> Array:
        if name not in _NAMES:
            raise KeyError(name)
        parts = [
            np.broadcast_to(self._of(way.joint, way.machine_nm)[name], way.machine_nm.shape)
            for way in self.ways
        ]
        return np.hstack(parts)

    def __iter__(self) -> Iterator[str]:
        return iter(_NAMES)

    def __len__(self) -> int:
        return len(_NAMES)

    def along(self, control: NDArray[np.int64]) -> dict[str, Array]:
        """name -> (time,) of one control per step."""
        steps, first = np.arange(len(control)), 0
        found = {name: np.empty(len(control)) for name in _NAMES}
        for way in self.ways:
            level, width = control - first, way.machine_nm.shape[1]
            taken = (level >= 0) & (level < width)
            first += width
            if taken.any():
                torque = way.machine_nm[steps, np.clip(level, 0, width - 1)]
                for name, flow in self._of(way.joint, torque[:, None]).items():
                    found[name][taken] = np.broadcast_to(flow, (len(control), 1))[taken, 0]
        return found

    def _of(self, joint: Joint, machine_nm: Array) -> dict[str, Array]:
        """name -> flows of (time, level) torques of the machine, some (time, 1)."""
        engine_kgps = np.zeros_like(machine_nm)
        torques = balance(self.architecture, self.demand, joint, machine_nm)
        if joint.engine_on:
            engine_kgps = self.architecture.engine.fuel_kgps(
                torques.engine, joint.engine_speed_radps[:, None]
            )
        loss_w = self.architecture.machines[0].loss_w(
            machine_nm, joint.machine_speed_radps[:, None]
        )
        return _flows(
            self.architecture, self.demand, joint, torques, np.nan_to_num(engine_kgps),
            np.nan_to_num(loss_w),
        )  # fmt: skip


def _flows(
    architecture: Architecture,
    demand: Demand,
    joint: Joint,
    torques: Balance,
    fuel_kgps: Array,
    machine_loss_w: Array,
) -> dict[str, Array]:
    """Powers and losses. Clutch, gears, machine and brakes lose by laws of their own, so that the balances of
    shafts and car are checks; the engine's loss is what fuel power is not turned into work."""
    engine_speed = joint.engine_speed_radps[:, None]
    machine_speed = joint.machine_speed_radps[:, None]
    wheel_speed = demand.wheel_speed_radps[:, None]
    ratio, efficiency = joint.gear_ratio[:, None], joint.gear_efficiency[:, None]
    own = ~(joint.upstream | joint.shared)[:, None]
    fuel_power = fuel_kgps * architecture.engine.heating_value_jpkg
    machine_power = torques.machine * machine_speed
    engine_inertia = architecture.engine.inertia_kgm2 * joint.engine_accel_radps2[:, None]
    machine_inertia = architecture.machines[0].inertia_kgm2 * joint.machine_accel_radps2[:, None]
    own_loss = _gear_loss_w(torques.machine_net * machine_speed, joint.machine_efficiency[:, None])
    return {
        "engine_torque_nm": torques.engine,
        "engine_speed_radps": engine_speed,
        "machine_torque_nm": torques.machine,
        "machine_speed_radps": machine_speed,
        "fuel_power_w": fuel_power,
        "engine_loss_w": fuel_power - torques.engine * engine_speed,
        "engine_inertia_w": engine_inertia * engine_speed,
        "machine_electric_w": machine_power + machine_loss_w,
        "machine_loss_w": machine_loss_w,
        "machine_inertia_w": machine_inertia * machine_speed,
        "machine_upstream": joint.upstream[:, None].astype(float),
        "machine_shared": joint.shared[:, None].astype(float),
        "clutch_in_w": torques.clutch * engine_speed,
        "clutch_loss_w": torques.clutch * joint.slip_radps[:, None],
        "gearbox_out_w": output_torque_nm(torques.gearbox_in, ratio, efficiency) * wheel_speed,
        "gearbox_loss_w": _gear_loss_w(torques.gearbox_in * ratio * wheel_speed, efficiency),
        "machine_gear_out_w": torques.wheel_own * wheel_speed,
        "machine_gear_loss_w": np.where(own, own_loss, 0.0),
        "brake_power_w": torques.brake * wheel_speed,
        "wheel_power_w": demand.wheel_power_w[:, None],
        "auxiliary_power_w": np.full((1, 1), architecture.vehicle.auxiliary_power_w),
    }


def _gear_loss_w(input_w: Array, efficiency: Array) -> Array:
    return np.where(input_w > 0, input_w * (1 - efficiency), input_w * (1 - 1 / efficiency))
