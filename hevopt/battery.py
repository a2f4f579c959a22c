"""Battery, equations (19) to (21): open-circuit voltage behind one resistance, stored energy as state.

    U = Uoc(SOC) - R(SOC, sign of I) I,   P = U I,   dE/dt = -Uoc I x (coulombic efficiency while charging)

so that dE = -(P + R I²) dt on discharge. E is the chemical energy above SOC 0, E = Q times the integral of
Uoc over SOC. Uoc and R are piecewise linear in SOC, so E is piecewise quadratic and both directions are
closed form: Uoc² = Uoc_i² + 2 (dUoc/dSOC) (E - E_i) / Q within a segment.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hevopt._battery_kernels import BatteryArrays
from hevopt.errors import DataError

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Battery:
    """A battery pack at its terminals; curves over SOC are linear between their points.

    soc: (point,) increasing, from at most soc_min to at least soc_max
    open_circuit_v, discharge_ohm, charge_ohm: (point,)
    power_max_*_w and current_max_*_a: limits at the terminals, inf where there is none
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

    def __post_init__(self) -> None:
        for field in ("soc", "open_circuit_v", "discharge_ohm", "charge_ohm"):
            values = np.array(getattr(self, field), dtype=np.float64)
            values.flags.writeable = False
            object.__setattr__(self, field, values)
        self._check()

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

    @property
    def point_energy_j(self) -> Array:
        """(point,) stored energy at the curves' points, 0 at the first."""
        mean_v = (self.open_circuit_v[1:] + self.open_circuit_v[:-1]) / 2
        return np.concatenate([[0.0], np.cumsum(self.capacity_as * mean_v * np.diff(self.soc))])

    @property
    def arrays(self) -> BatteryArrays:
        """The same for compiled loops."""
        return BatteryArrays(
            self.soc,
            self.open_circuit_v,
            self.discharge_ohm,
            self.charge_ohm,
            self.point_energy_j,
            float(self.capacity_as),
            float(self.coulombic_efficiency),
        )


def energy_j(battery: Battery, soc: float | Array) -> Array:
    """Stored energy at a state of charge within the curves."""
    i = _segment(battery.soc, soc)
    step = np.asarray(soc) - battery.soc[i]
    slope = np.diff(battery.open_circuit_v)[i] / np.diff(battery.soc)[i]
    volt_step = (battery.open_circuit_v[i] + slope * step / 2) * step
    return battery.point_energy_j[i] + battery.capacity_as * volt_step


def soc(battery: Battery, energy: float | Array) -> Array:
    """State of charge at a stored energy: the inverse of `energy_j`."""
    i = _segment(battery.point_energy_j, energy)
    low_v = battery.open_circuit_v[i]
    slope = np.diff(battery.open_circuit_v)[i] / np.diff(battery.soc)[i]
    charge = (np.asarray(energy) - battery.point_energy_j[i]) / battery.capacity_as
    root = np.sqrt(np.maximum(low_v**2 + 2 * slope * charge, 0.0))
    return battery.soc[i] + 2 * charge / (low_v + root)


def chemical_power_w(
    battery: Battery, power_w: Array, open_circuit_v: Array | float, resistance_ohm: Array | float
) -> Array:
    """Rate at which stored energy falls for a terminal power; NaN beyond what the voltage can deliver."""
    root = open_circuit_v**2 - 4 * resistance_ohm * power_w
    current = 2 * power_w / (open_circuit_v + np.sqrt(np.where(root >= 0, root, np.nan)))
    chemical = open_circuit_v * current
    return np.where(power_w < 0, battery.coulombic_efficiency * chemical, chemical)


def best_voltage_and_resistance(battery: Battery, charging: bool) -> tuple[float, float]:
    """Highest voltage and lowest resistance within the SOC window: no state of charge loses less."""
    curve = battery.charge_ohm if charging else battery.discharge_ohm
    inside = (battery.soc > battery.soc_min) & (battery.soc < battery.soc_max)
    ends = np.interp([battery.soc_min, battery.soc_max], battery.soc, curve)
    voltage = float(np.interp(battery.soc_max, battery.soc, battery.open_circuit_v))
    return voltage, float(min(ends.min(), curve[inside].min(initial=np.inf)))


def within_limits(battery: Battery, power_w: Array) -> NDArray[np.bool_]:
    """Where the battery can deliver or take a power at every SOC of its window."""
    lowest_v = float(np.interp(battery.soc_min, battery.soc, battery.open_circuit_v))
    inside = (battery.soc > battery.soc_min) & (battery.soc < battery.soc_max)
    edges = [battery.soc_min, battery.soc_max]
    highest_ohm = [
        max(np.interp(edges, battery.soc, r).max(), r[inside].max(initial=0.0))
        for r in (battery.discharge_ohm, battery.charge_ohm)
    ]
    resistance = np.where(power_w < 0, highest_ohm[1], highest_ohm[0])
    root = lowest_v**2 - 4 * resistance * power_w
    current = 2 * power_w / (lowest_v + np.sqrt(np.maximum(root, 0.0)))
    return (
        (root >= 0)
        & (power_w <= battery.power_max_discharge_w)
        & (power_w >= -battery.power_max_charge_w)
        & (current <= battery.current_max_discharge_a)
        & (current >= -battery.current_max_charge_a)
    )


def _segment(points: Array, value: float | Array) -> NDArray[np.int64]:
    return np.clip(np.searchsorted(points, value, "right") - 1, 0, len(points) - 2)
