"""Carried out of hevopt/report.py."""

import io
from pathlib import Path

import numpy as np

from hevopt.files.writing import write_whole
from hevopt.problem.problem import Problem

TABLE_README = """hevopt control table. Arrays are (time, control) unless said otherwise.
fuel_kg, nox_kg      burnt and emitted in the step; finite also where not feasible
battery_power_w      at the terminals during the step, > 0 discharges
feasible, reject     True where the control can be used; reject: bits saying why not, 0 = feasible
mode                 (control,) discrete state the control leads to
switch_fuel_kg, switch_energy_j    (mode, mode) [from, to], or (time, mode, mode): fuel burnt and stored energy
                     taken by going from one mode to another, start_mode before step 0
switch_allowed       (mode, mode) [from, to], or (time, mode, mode)
controls             (control,) labels: engine on or off, engine gear (0: the cycle's), machine gear, torque level
time_s, step_s       (time,) start and length of the steps
soc_start, soc_end_min, soc_min, soc_max    state of charge: start, least at the end, window
nox_weight           kg of fuel that a kg of NOx counts; objective = sum(fuel + switch_fuel + nox_weight nox)
battery_soc, battery_open_circuit_v, battery_discharge_ohm, battery_charge_ohm    (point,) curves of the pack,
                     linear between points; battery_capacity_as; battery_coulombic_efficiency
Step of the battery, with stored energy E as the state:
  dE/dSOC = battery_capacity_as * Uoc(SOC), E = 0 at battery_soc[0]; R of discharge where P > 0, else of charge
  I = 2 P / (Uoc + sqrt(Uoc^2 - 4 R P)) at the SOC before the step
  E = E - switch_energy_j where the mode is switched, before the step; it must keep to the window too
  E_next = E - step_s * Uoc * I * (battery_coulombic_efficiency where I < 0, else 1)
"""


def write_table(path: Path, problem: Problem) -> None:
    """The problem as .npz arrays, enough for another solver to repeat ours; documented in its README entry."""
    table, pack = problem.table, problem.battery
    labels = [
        f"engine {'on' if c.engine_on else 'off'}, engine gear {c.engine_gear}, "
        f"machine gear {c.machine_gear}, {c.level}"
        for c in table.controls
    ]
    contents = io.BytesIO()
    np.savez_compressed(
        contents,
        README=np.array(TABLE_README),
        time_s=table.time_s, step_s=table.step_s, fuel_kg=table.fuel_kg, nox_kg=table.nox_kg,
        battery_power_w=table.battery_power_w, feasible=table.feasible, reject=table.reject,
        mode=table.mode, switch_fuel_kg=table.switch_fuel_kg, switch_allowed=table.switch_allowed,
        switch_energy_j=table.switch_energy_j,
        controls=np.array(labels), start_mode=problem.start_mode, nox_weight=problem.nox_weight,
        soc_start=problem.soc_start, soc_end_min=problem.soc_end_min, soc_min=pack.soc_min,
        soc_max=pack.soc_max, battery_soc=pack.soc, battery_open_circuit_v=pack.open_circuit_v,
        battery_discharge_ohm=pack.discharge_ohm, battery_charge_ohm=pack.charge_ohm,
        battery_capacity_as=pack.capacity_as,
        battery_coulombic_efficiency=pack.coulombic_efficiency,
    )  # fmt: skip
    write_whole(path, contents.getvalue())
