"""Battery, equations (19) to (21): open-circuit voltage behind one resistance, stored energy as state.

    U = Uoc(SOC) - R(SOC, sign of I) I,   P = U I,   dE/dt = -Uoc I x (coulombic efficiency while charging)

so that dE = -(P + R I²) dt on discharge. E is the chemical energy above SOC 0, E = Q times the integral of
Uoc over SOC. Uoc and R are piecewise linear in SOC, so E is piecewise quadratic and both directions are
closed form: Uoc² = Uoc_i² + 2 (dUoc/dSOC) (E - E_i) / Q within a segment.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from hevopt.display.facts import Shown
from hevopt.errors import DataError
from hevopt.problem.arrays import Array, Flags
from hevopt.problem.frozen import frozen
from hevopt.problem.once import once

# Compiled loops are read where they are called: a car's file is read without.
if TYPE_CHECKING:
    from hevopt.problem._battery_kernels import BatteryArrays

# What simulate lets a plan leave the window by: shares of the window, or of all stored energy if that is more.
_WINDOW_TOLERANCE, _ENERGY_ROUNDING = 1e-9, 4e-12
# Rounding of a power given as the limit itself.
_ROUNDING = 1e-12


@dataclass(frozen=True, slots=True, eq=False, repr=False, weakref_slot=True)
class Battery(Shown):
    """A battery pack at its terminals; curves over SOC are linear between their points.

    soc: (point,) increasing, from at most soc_min to at least soc_max
    open_circuit_v, discharge_ohm, charge_ohm: (point,)
    power_max_*_w and current_max_*_a: limits at the terminals, inf where there is none
    voltage_*_v: lowest while it discharges and highest while it charges, at the terminals
    """

    soc: Array
    open_circuit_v: Array
    discharge_ohm: Array
    charge_ohm: Array
    capacity_as: float
    coulombic_efficiency: float = 1.0
    soc_min: float = 0.0
    soc_max: float = 1.0
    power_max_discharge_w: float = np.inf
    power_max_charge_w: float = np.inf
    current_max_discharge_a: float = np.inf
    current_max_charge_a: float = np.inf
    voltage_min_v: float = 0.0
    voltage_max_v: float = np.inf

    def __post_init__(self) -> None:
        for field in ("soc", "open_circuit_v", "discharge_ohm", "charge_ohm"):
            values = np.array(getattr(self, field), dtype=np.float64)
            values.flags.writeable = False
            object.__setattr__(self, field, values)
        self._check()

    def _facts(self) -> dict[str, object]:
        low, high = energy_j(self, np.array([self.soc_min, self.soc_max]))
        return {
            "points": len(self.soc),
            "capacity_as": self.capacity_as,
            "open_circuit_v": (float(self.open_circuit_v[0]), float(self.open_circuit_v[-1])),
            "soc_window": (self.soc_min, self.soc_max),
            "window_j": float(high - low),
        }

    def _check(self) -> None:
        curves = (self.open_circuit_v, self.discharge_ohm, self.charge_ohm)
        if (
            self.soc.ndim != 1
            or len(self.soc) < 2
            or any(c.shape != self.soc.shape for c in curves)
        ):
            raise DataError(
                "battery: soc, open_circuit_v, discharge_ohm and charge_ohm must have one length "
                f">= 2; found shapes {[self.soc.shape, *(c.shape for c in curves)]}"
            )
        if not all(np.isfinite(values).all() for values in (self.soc, *curves)):
            raise DataError("battery: a curve holds NaN or infinite values")
        if (np.diff(self.soc) <= 0).any() or (np.diff(self.open_circuit_v) < 0).any():
            raise DataError(
                "battery: soc must increase and open_circuit_v must not fall from point to point"
            )
        if (self.open_circuit_v <= 0).any() or (curves[1] < 0).any() or (curves[2] < 0).any():
            raise DataError("battery: open_circuit_v must be > 0 and resistances >= 0")
        if not 0 < self.coulombic_efficiency <= 1 or not self.capacity_as > 0:
            raise DataError(
                f"battery: coulombic_efficiency {self.coulombic_efficiency} must lie in (0, 1] and "
                f"capacity_as {self.capacity_as} be > 0"
            )
        if not self.soc[0] <= self.soc_min < self.soc_max <= self.soc[-1]:
            raise DataError(
                f"battery: SOC window [{self.soc_min:g}, {self.soc_max:g}] is empty or outside the "
                f"curves' range [{self.soc[0]:g}, {self.soc[-1]:g}]; allowed: min < max within it"
            )
        low_v, high_v = np.interp([self.soc_min, self.soc_max], self.soc, self.open_circuit_v)
        if not 0 <= self.voltage_min_v < low_v or not self.voltage_max_v > high_v:
            raise DataError(
                f"battery: voltage limits {self.voltage_min_v:g} and {self.voltage_max_v:g} V of the pack; its "
                f"open-circuit voltage runs from {low_v:g} to {high_v:g} V in the SOC window; allowed: a lowest "
                "below and a highest above these"
            )

    @property
    @once
    def point_energy_j(self) -> Array:
        """(point,) stored energy at the curves' points, 0 at the first."""
        mean_v = (self.open_circuit_v[1:] + self.open_circuit_v[:-1]) / 2
        steps_j = self.capacity_as * mean_v * np.diff(self.soc)
        return frozen("point_energy_j", np.concatenate([[0.0], np.cumsum(steps_j)]))

    @property
    @once
    def arrays(self) -> "BatteryArrays":
        """The same for compiled loops."""
        from hevopt.problem._battery_kernels import BatteryArrays

        return BatteryArrays(
            self.soc,
            self.open_circuit_v,
            self.discharge_ohm,
            self.charge_ohm,
            self.point_energy_j,
            float(self.capacity_as),
            float(self.coulombic_efficiency),
        )

    @property
    @once
    def granted_window_j(self) -> tuple[float, float]:
        """Stored energy between which a plan must stay: the window, and beyond it what rounding may take."""
        low, high = energy_j(self, np.array([self.soc_min, self.soc_max]))
        slack = max(_WINDOW_TOLERANCE * (high - low), _ENERGY_ROUNDING * high)
        return float(low - slack), float(high + slack)

    @once
    def within_window(self) -> "BatteryArrays":
        """The curves cut to the granted window, their ends interpolated: all that a proof may see of them."""
        from hevopt.problem import _battery_kernels as kernels

        whole = self.arrays
        ends = kernels.states(np.array(self.granted_window_j), whole)
        inner = (self.soc > ends[0, 0]) & (self.soc < ends[0, 1])
        first, last = ends[:, :1], ends[:, 1:]
        points = np.stack([curve[inner] for curve in whole[:4]])
        low, high = self.granted_window_j
        curves = np.concatenate([first, points, last], axis=1)
        soc, voltage, discharge, charge = (frozen("curves", curve) for curve in curves)
        energy_j = frozen("energy_j", np.concatenate([[low], whole.energy_j[inner], [high]]))
        return kernels.BatteryArrays(
            soc, voltage, discharge, charge, energy_j, whole.capacity_as, whole.coulombic_efficiency
        )


def energy_j(battery: Battery, soc: float | Array) -> Array:
    """Stored energy at a state of charge within the curves."""
    i = np.clip(np.searchsorted(battery.soc, soc, "right") - 1, 0, len(battery.soc) - 2)
    step = np.asarray(soc) - battery.soc[i]
    slope = np.diff(battery.open_circuit_v)[i] / np.diff(battery.soc)[i]
    volt_step = (battery.open_circuit_v[i] + slope * step / 2) * step
    stored_j: Array = battery.point_energy_j[i] + battery.capacity_as * volt_step
    return stored_j


def soc(battery: Battery, energy: float | Array) -> Array:
    """State of charge at a stored energy: the inverse of `energy_j`."""
    at: Array = states(battery, energy)[0]
    return at


def states(battery: Battery, energy: float | Array) -> Array:
    """(4, ...) SOC, open-circuit voltage, discharge and charge resistance at stored energies."""
    from hevopt.problem import _battery_kernels as kernels

    energy = np.asarray(energy, dtype=np.float64)
    return kernels.states(energy.ravel(), battery.arrays).reshape(4, *energy.shape)


def source_power_w(power_w: Array, open_circuit_v: Array | float, ohm: Array | float) -> Array:
    """(2, ...) Uoc I, of which the terminals get P and R I² is lost, and the root Uoc - 2 R I.

    NaN beyond what the voltage can deliver.
    """
    from hevopt.problem import _battery_kernels as kernels

    parts = np.broadcast_arrays(power_w, open_circuit_v, ohm)
    flat = kernels.source_powers(*(np.ravel(part).astype(np.float64) for part in parts))
    return flat.reshape(2, *parts[0].shape)


def chemical_power_w(
    battery: Battery, power_w: Array, open_circuit_v: Array | float, resistance_ohm: Array | float
) -> Array:
    """Rate at which stored energy falls for a terminal power; NaN beyond what the voltage can deliver."""
    chemical, _ = source_power_w(power_w, open_circuit_v, resistance_ohm)
    drain_w: Array = np.where(power_w < 0, battery.coulombic_efficiency * chemical, chemical)
    return drain_w


def step_flows(
    battery: Battery, before_j: Array, after_j: Array, power_w: Array, step_s: float | Array
) -> dict[str, Array]:
    """Powers, voltage and current of steps, (time,): the loss from current and resistance before each step.

    before_j, after_j: (time,) stored energy; the chemical power is what it falls by, so that the loss can be held
    against it
    """
    from hevopt.problem import _battery_kernels as kernels

    before_j = np.ascontiguousarray(before_j, dtype=np.float64)
    power_w = np.ascontiguousarray(power_w, dtype=np.float64)
    loss, voltage, current = kernels.currents(before_j, power_w, battery.arrays)
    return {
        "battery_chemical_w": (before_j - after_j) / step_s,
        "battery_loss_w": loss,
        "battery_voltage_v": voltage,
        "battery_current_a": current,
    }


def best_voltage_and_resistance(battery: Battery, charging: bool) -> tuple[float, float]:
    """Highest voltage and lowest resistance within the SOC window: no state of charge loses less."""
    inside = battery.within_window()
    curve = inside.charge_ohm if charging else inside.discharge_ohm
    return float(inside.open_circuit_v.max()), float(curve.min())


def power_limits_w(battery: Battery) -> tuple[float, float]:
    """Least and greatest terminal power that the battery takes and delivers at every SOC of its window.

    Between two points of the curves U and R are linear in SOC. With a current limit i it takes U i + R i², linear,
    so least at a point. It delivers U i - R i², linear, or where i is beyond U / 2R the peak U² / 4R, which is
    convex (a square over a linear function): least at a point, where both are the same, or where the peak is
    level, at 2 R U' = U R'. A voltage limit V lets V |V - U| / R through, a quotient of two linear functions, which
    is monotone between points; where V is below U / 2 the peak comes first.
    """
    ends = np.array([battery.soc_min, battery.soc_max])
    inner = battery.soc[(battery.soc > ends[0]) & (battery.soc < ends[1])]
    points = np.concatenate([ends[:1], inner, ends[1:]])
    voltage, discharge, charge = (
        np.interp(points, battery.soc, curve)
        for curve in (battery.open_circuit_v, battery.discharge_ohm, battery.charge_ohm)
    )
    limit = battery.current_max_charge_a
    taken = np.inf if limit == np.inf else float(np.min(voltage * limit + charge * limit**2))
    delivered = _least_delivered_w(voltage, discharge, battery.current_max_discharge_a)
    taken = min(taken, _least_at_w(battery.voltage_max_v, battery.voltage_max_v - voltage, charge))
    lowest = battery.voltage_min_v
    # Down to half of the open-circuit voltage the power still rises with the current.
    limits = lowest >= voltage / 2
    drop_v = np.where(limits, voltage - lowest, np.inf)
    delivered = min(delivered, _least_at_w(lowest, drop_v, discharge))
    return (
        -min(taken, battery.power_max_charge_w),
        min(delivered, battery.power_max_discharge_w),
    )


def _least_at_w(limit_v: float, drop_v: Array, ohm: Array) -> float:
    """Least power at a voltage limit, (point,) away from open circuit by a drop; inf without any."""
    bounded = np.isfinite(drop_v) & (ohm > 0)
    if not bounded.any():
        return np.inf
    return float(np.min(limit_v * drop_v[bounded] / ohm[bounded]))


def within_limits(battery: Battery, power_w: Array) -> Flags:
    """Where the battery can deliver or take a power at every SOC of its window, rounding aside."""
    least, greatest = power_limits_w(battery)
    within: Flags = (power_w >= least * (1 + _ROUNDING)) & (power_w <= greatest * (1 + _ROUNDING))
    return within


def _least_delivered_w(voltage: Array, ohm: Array, current_a: float) -> float:
    """Least over the segments between points of the most that voltage and current limit let through."""
    volt_step, ohm_step = np.diff(voltage), np.diff(ohm)
    low_v, low_ohm = voltage[:-1], ohm[:-1]
    bends = [np.zeros_like(low_v), np.ones_like(low_v)]
    pairs = [(ohm_step * low_v - 2 * volt_step * low_ohm, volt_step * ohm_step)]
    if current_a < np.inf:
        pairs.append((2 * current_a * low_ohm - low_v, volt_step - 2 * current_a * ohm_step))
    for over, under in pairs:
        share = np.divide(over, under, out=np.zeros_like(over), where=under != 0)
        bends.append(np.clip(share, 0.0, 1.0))
    share = np.stack(bends)
    at_v, at_ohm = low_v + share * volt_step, low_ohm + share * ohm_step
    half_v = at_v / 2
    peak_a = np.divide(half_v, at_ohm, out=np.full_like(at_v, np.inf), where=at_ohm > 0)
    flowing = np.minimum(current_a, peak_a)
    bounded = np.isfinite(flowing)
    flowing = np.where(bounded, flowing, 0.0)
    through = np.where(flowing < peak_a, at_v * flowing - at_ohm * flowing**2, half_v * flowing)
    return float(np.min(np.where(bounded, through, np.inf)))
