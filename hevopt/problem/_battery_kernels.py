"""Compiled battery step: the one step that simulation, dynamic programming, rules and bounds share."""

from typing import NamedTuple

import numpy as np

from hevopt._compile import compiled
from hevopt.problem.arrays import Array

# Share of Uoc² by which rounding may carry a power beyond U²/4R, the most the voltage can deliver.
_BEYOND_PEAK = 1e-9
# Least share of Uoc that the root counts in a slope: at U²/4R the slope has no end.
_LEAST_ROOT = 1e-6


class BatteryArrays(NamedTuple):
    """Battery curves over SOC as compiled loops read them; see battery.Battery."""

    soc: Array
    open_circuit_v: Array
    discharge_ohm: Array
    charge_ohm: Array
    energy_j: Array
    capacity_as: float
    coulombic_efficiency: float


@compiled(inline="always")
def _segment_at(energy: float, battery: BatteryArrays) -> int:
    i = 0
    while i < len(battery.energy_j) - 2 and energy >= battery.energy_j[i + 1]:
        i += 1
    return i


@compiled(inline="always")
def _state_in(i: int, energy: float, battery: BatteryArrays) -> tuple[float, float, float, float]:
    low_v = battery.open_circuit_v[i]
    width = battery.soc[i + 1] - battery.soc[i]
    slope = (battery.open_circuit_v[i + 1] - low_v) / width
    charge = (energy - battery.energy_j[i]) / battery.capacity_as
    voltage = np.sqrt(max(low_v * low_v + 2.0 * slope * charge, 1e-12 * low_v * low_v))
    soc = battery.soc[i] + 2.0 * charge / (low_v + voltage)
    share = (soc - battery.soc[i]) / width
    discharge = battery.discharge_ohm[i] * (1.0 - share) + battery.discharge_ohm[i + 1] * share
    charging = battery.charge_ohm[i] * (1.0 - share) + battery.charge_ohm[i + 1] * share
    return soc, voltage, discharge, charging


@compiled(inline="always")
def state_at(energy: float, battery: BatteryArrays) -> tuple[float, float, float, float]:
    """SOC, open-circuit voltage, discharge and charge resistance at a stored energy."""
    return _state_in(_segment_at(energy, battery), energy, battery)


@compiled(inline="always")
def source_power(power: float, voltage: float, resistance: float) -> tuple[float, float]:
    """Uoc I, and the root sqrt(Uoc² - 4 R P) = Uoc - 2 R I; NaN beyond what the voltage can deliver."""
    squared = voltage * voltage - 4.0 * resistance * power
    if squared < -_BEYOND_PEAK * voltage * voltage:
        return np.nan, np.nan
    root = np.sqrt(max(squared, 0.0))
    return voltage * 2.0 * power / (voltage + root), root


@compiled(inline="always")
def chemical_power(
    power: float, voltage: float, discharge: float, charging: float, efficiency: float
) -> float:
    """Rate at which stored energy falls; NaN beyond what the voltage can deliver."""
    chemical, _ = source_power(power, voltage, charging if power < 0.0 else discharge)
    return efficiency * chemical if power < 0.0 else chemical


@compiled(bare=True)
def chemical_power_at(power: float, energy: float, battery: BatteryArrays) -> float:
    """Rate at which stored energy falls for a terminal power at a stored energy."""
    _, voltage, discharge, charging = state_at(energy, battery)
    return chemical_power(power, voltage, discharge, charging, battery.coulombic_efficiency)


class CurvesAt(NamedTuple):
    """The curves at a stored energy: voltage, resistances, and their slopes by state of charge in the segment."""

    voltage: float
    discharge: float
    charging: float
    volt_slope: float
    discharge_slope: float
    charging_slope: float


@compiled(inline="always")
def touch_at(energy: float, battery: BatteryArrays) -> CurvesAt:
    """The curves at a stored energy."""
    i = _segment_at(energy, battery)
    _, voltage, discharge, charging = _state_in(i, energy, battery)
    width = battery.soc[i + 1] - battery.soc[i]
    return CurvesAt(
        voltage,
        discharge,
        charging,
        (battery.open_circuit_v[i + 1] - battery.open_circuit_v[i]) / width,
        (battery.discharge_ohm[i + 1] - battery.discharge_ohm[i]) / width,
        (battery.charge_ohm[i + 1] - battery.charge_ohm[i]) / width,
    )


@compiled(inline="always")
def touching(
    power: float, touch: CurvesAt, capacity_as: float, efficiency: float
) -> tuple[float, float]:
    """Rate at which stored energy falls, and its derivative by stored energy within the segment.

    At constant P the current I obeys  dI/dU = -I / root,  dI/dR = I² / root,  so that of U I
    d(U I)/dU = -2 R I² / root  and  d(U I)/dR = U I² / root;  SOC rises by 1 / (Q U) per joule.
    """
    voltage = touch.voltage
    resistance = touch.charging if power < 0.0 else touch.discharge
    ohm_slope = touch.charging_slope if power < 0.0 else touch.discharge_slope
    kept = efficiency if power < 0.0 else 1.0
    chemical, root = source_power(power, voltage, resistance)
    current = chemical / voltage
    change = current * current * (voltage * ohm_slope - 2.0 * resistance * touch.volt_slope)
    per_joule = max(root, _LEAST_ROOT * voltage) * capacity_as * voltage
    return kept * chemical, kept * change / per_joule


@compiled()
def drain_and_slope(power: float, energy: float, battery: BatteryArrays) -> tuple[float, float]:
    """Rate at which stored energy falls, and its derivative by stored energy; see `touching`."""
    touch = touch_at(energy, battery)
    return touching(power, touch, battery.capacity_as, battery.coulombic_efficiency)


@compiled()
def trace(
    start_j: float, switch_j: Array, power_w: Array, step_s: Array, battery: BatteryArrays
) -> Array:
    """Stored energy after every step, (time + 1,), by the step all parts of hevopt share.

    switch_j: (time,) taken before the step, at whose outcome the step is made
    """
    energy = np.empty(len(power_w) + 1)
    energy[0] = start_j
    for k in range(len(power_w)):
        switched = energy[k] - switch_j[k]
        energy[k + 1] = switched - step_s[k] * chemical_power_at(power_w[k], switched, battery)
    return energy


@compiled(inline="always")
def lossy_current(
    power: float, voltage: float, resistance: float, efficiency: float
) -> tuple[float, float]:
    """Current, and what resistance and incomplete charging lose at it."""
    current = source_power(power, voltage, resistance)[0] / voltage
    uncharged = (1.0 - efficiency) * max(-voltage * current, 0.0)
    return current, resistance * (current * current) + uncharged


@compiled()
def currents(before: Array, power: Array, battery: BatteryArrays) -> Array:
    """(3, time) loss, voltage at the terminals and current of steps, by stored energy before each and its power."""
    result = np.empty((3, len(power)))
    for k in range(len(power)):
        _, voltage, discharge, charging = state_at(before[k], battery)
        ohm = charging if power[k] < 0.0 else discharge
        current, loss = lossy_current(power[k], voltage, ohm, battery.coulombic_efficiency)
        result[0, k], result[1, k], result[2, k] = loss, voltage - ohm * current, current
    return result


@compiled()
def followed(start_j: float, power: Array, step_s: float, battery: BatteryArrays) -> Array:
    """(4, time + 1) stored energy and state of charge as of `trace`, and of the step that follows, none behind the
    last, the rate at which stored energy falls and the loss."""
    steps, energy = len(power), start_j
    result = np.zeros((4, steps + 1))
    for k in range(steps):
        soc, voltage, discharge, charging = state_at(energy, battery)
        kept = battery.coulombic_efficiency
        _, loss = lossy_current(power[k], voltage, charging if power[k] < 0.0 else discharge, kept)
        after = energy - step_s * chemical_power(power[k], voltage, discharge, charging, kept)
        result[0, k], result[1, k], result[2, k] = energy, soc, (energy - after) / step_s
        result[3, k], energy = loss, after
    result[0, steps], result[1, steps] = energy, state_at(energy, battery)[0]
    return result


@compiled()
def states(energy: Array, battery: BatteryArrays) -> Array:
    """(4, n) SOC, open-circuit voltage, discharge and charge resistance at many stored energies."""
    result = np.empty((4, len(energy)))
    for n in range(len(energy)):
        soc, voltage, discharge, charging = state_at(energy[n], battery)
        result[0, n], result[1, n], result[2, n], result[3, n] = soc, voltage, discharge, charging
    return result


@compiled()
def source_powers(power: Array, voltage: Array, resistance: Array) -> Array:
    """(2, n) Uoc I and root of many powers, each at its own voltage and resistance."""
    result = np.empty((2, len(power)))
    for n in range(len(power)):
        result[0, n], result[1, n] = source_power(power[n], voltage[n], resistance[n])
    return result


@compiled()
def amplification(power: Array, battery: BatteryArrays) -> Array:
    """(n,) how much rounding of Uoc² can grow in the root, U / sqrt(U² - 4 R P), at most 1 / sqrt(epsilon).

    Of each segment between two points the lowest voltage and the highest resistance.
    """
    most = 1.0 / np.sqrt(np.finfo(np.float64).eps)
    result = np.ones(len(power))
    for n in range(len(power)):
        if power[n] <= 0.0:
            continue
        for i in range(len(battery.soc) - 1):
            voltage = battery.open_circuit_v[i]
            resistance = max(battery.discharge_ohm[i], battery.discharge_ohm[i + 1])
            squared = voltage * voltage - 4.0 * resistance * power[n]
            grown = most if squared <= 0.0 else min(voltage / np.sqrt(squared), most)
            result[n] = max(result[n], grown)
    return result
