"""Compiled battery step: the one step that simulation, dynamic programming and bounds share."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hevopt._compile import compiled


class BatteryArrays(NamedTuple):
    """Battery curves over SOC as compiled loops read them; see battery.Battery."""

    soc: NDArray[np.float64]
    open_circuit_v: NDArray[np.float64]
    discharge_ohm: NDArray[np.float64]
    charge_ohm: NDArray[np.float64]
    energy_j: NDArray[np.float64]
    capacity_as: float
    coulombic_efficiency: float


@compiled(inline="always")
def state_at(energy, battery):
    """SOC, open-circuit voltage, discharge and charge resistance at a stored energy."""
    i = 0
    while i < len(battery.energy_j) - 2 and energy >= battery.energy_j[i + 1]:
        i += 1
    low_v = battery.open_circuit_v[i]
    width = battery.soc[i + 1] - battery.soc[i]
    slope = (battery.open_circuit_v[i + 1] - low_v) / width
    charge = (energy - battery.energy_j[i]) / battery.capacity_as
    voltage = np.sqrt(max(low_v * low_v + 2.0 * slope * charge, 1e-12))
    soc = battery.soc[i] + 2.0 * charge / (low_v + voltage)
    share = (soc - battery.soc[i]) / width
    discharge = battery.discharge_ohm[i] * (1.0 - share) + battery.discharge_ohm[i + 1] * share
    charging = battery.charge_ohm[i] * (1.0 - share) + battery.charge_ohm[i + 1] * share
    return soc, voltage, discharge, charging


@compiled(inline="always")
def chemical_power(power, voltage, discharge, charging, efficiency):
    """Rate at which stored energy falls; NaN beyond what the voltage can deliver."""
    resistance = charging if power < 0.0 else discharge
    root = voltage * voltage - 4.0 * resistance * power
    if root < 0.0:
        return np.nan
    chemical = voltage * 2.0 * power / (voltage + np.sqrt(root))
    return efficiency * chemical if power < 0.0 else chemical


@compiled()
def chemical_power_at(power, energy, battery):
    """Rate at which stored energy falls for a terminal power at a stored energy."""
    _, voltage, discharge, charging = state_at(energy, battery)
    return chemical_power(power, voltage, discharge, charging, battery.coulombic_efficiency)


@compiled()
def trace(start_j, power_w, step_s, battery):
    """Stored energy after every step, (time + 1,), by the step all parts of hevopt share."""
    energy = np.empty(len(power_w) + 1)
    energy[0] = start_j
    for k in range(len(power_w)):
        energy[k + 1] = energy[k] - step_s[k] * chemical_power_at(power_w[k], energy[k], battery)
    return energy
