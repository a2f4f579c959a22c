"""The only judge: what a plan burns and where the charge ends, with the true battery.

    E_k+1 = E_k - (rate at which stored energy falls for P_k at E_k) x step_k        (battery.py)

No strategy adds up its own fuel. An infeasible control, a forbidden switch or a state of charge outside the
window is an error, never clipped. The end charge is not judged here: a row that is not neutral is flagged.
"""

from collections.abc import Mapping
from typing import cast

import numpy as np
from numpy.typing import ArrayLike

from hevopt.errors import InfeasibleError
from hevopt.problem import battery as battery_model
from hevopt.problem._battery_kernels import trace
from hevopt.problem.arrays import Array, Indices
from hevopt.problem.flows import Flows
from hevopt.problem.problem import Problem, Trajectory
from hevopt.problem.table import REJECT_WORDS, ControlTable


def simulate(problem: Problem, control: ArrayLike) -> Trajectory:
    """The trajectory of control indices, (time,).

    Raises InfeasibleError at the first step whose control is no index or rejected, whose switch is forbidden or
    whose charge leaves the window.
    """
    table = problem.table
    control = _indices(table, control)
    steps = np.arange(len(control))
    mode = table.mode[control]
    before = np.concatenate([[problem.start_mode], mode[:-1]])
    if not table.switch_allowed[before, mode].all():
        k = int(np.argmin(table.switch_allowed[before, mode]))
        raise InfeasibleError(
            f"forbidden switch from mode {before[k]} to {mode[k]} at step {k} "
            f"(t = {table.time_s[k]:g} s)"
        )
    power_w = table.battery_power_w[steps, control]
    energy_j = trace(problem.start_j, power_w, table.step_s, problem.battery.arrays)
    _check_window(problem, energy_j)
    switch_kg = table.switch_fuel_kg[before, mode]
    fuel_kg = table.fuel_kg[steps, control] + switch_kg
    nox_kg = table.nox_kg[steps, control]
    flows = cast(Flows, table.flows).along(control)
    flows |= _battery_flows(problem, energy_j, power_w)
    return Trajectory(
        problem=problem,
        control=control,
        energy_j=energy_j,
        soc=battery_model.soc(problem.battery, energy_j),
        mode=mode,
        fuel_kg=fuel_kg,
        switch_fuel_kg=switch_kg,
        nox_kg=nox_kg,
        battery_power_w=power_w,
        cost_kg=float(np.sum(problem.cost_kg[steps, control] + switch_kg)),
        flows=flows,
        residuals=_residuals(table, flows, power_w),
    )


def total_cost_kg(problem: Problem, control: Indices) -> tuple[float, Array]:
    """Cost and stored energy of control indices, without the checks: for searches inside strategies."""
    table = problem.table
    steps = np.arange(len(control))
    mode = table.mode[control]
    before = np.concatenate([[problem.start_mode], mode[:-1]])
    cost = np.sum(problem.cost_kg[steps, control] + table.switch_fuel_kg[before, mode])
    power_w = table.battery_power_w[steps, control]
    return float(cost), trace(problem.start_j, power_w, table.step_s, problem.battery.arrays)


def _indices(table: ControlTable, plan: ArrayLike) -> Indices:
    """A plan as usable indices, (time,); InfeasibleError for what is none."""
    steps, controls = table.reject.shape
    allowed = f"allowed: whole numbers from 0 to {controls - 1}"
    try:
        given = np.asarray(plan)
    except ValueError:
        raise InfeasibleError(
            f"a plan of unequal rows; needed: one control per step, {steps}"
        ) from None
    if given.shape != (steps,):
        raise InfeasibleError(f"a plan needs one control per step, {steps}; found {given.shape}")
    if given.dtype.kind not in "iuf":
        raise InfeasibleError(f"a plan holds indices of controls, not {given.dtype}; {allowed}")
    # Written so that NaN is outside.
    wrong = ~((given >= 0) & (given < controls) & (given == np.floor(given)))
    if wrong.any():
        k = int(np.argmax(wrong))
        raise InfeasibleError(
            f"control {given[k]} at step {k} (t = {table.time_s[k]:g} s) is none; {allowed}"
        )
    control = given.astype(np.int64)
    _check_usable(table, control)
    return control


def _check_usable(table: ControlTable, control: Indices) -> None:
    reject = table.reject[np.arange(len(control)), control]
    if reject.any():
        k = int(np.argmax(reject != 0))
        reasons = [word for bit, word in REJECT_WORDS.items() if reject[k] & bit]
        raise InfeasibleError(
            f"control {control[k]} ({table.controls[control[k]]}) cannot be used at step {k} "
            f"(t = {table.time_s[k]:g} s): {', '.join(reasons) or f'reject bits {reject[k]}'}"
        )


def _check_window(problem: Problem, energy_j: Array) -> None:
    low, high = problem.battery.granted_window_j
    inside = (energy_j >= low) & (energy_j <= high)
    if not inside.all():
        k = int(np.argmin(inside))
        found = "more than the battery's voltage can deliver"
        if np.isfinite(energy_j[k]):
            found = f"SOC {float(battery_model.soc(problem.battery, energy_j[k])):.4f}"
        raise InfeasibleError(
            f"{found} after step {k - 1} (t = {problem.table.time_s[k - 1]:g} s); allowed: "
            f"{problem.battery.soc_min:g} to {problem.battery.soc_max:g}"
        )


def _battery_flows(problem: Problem, energy_j: Array, power_w: Array) -> dict[str, Array]:
    """Losses from current and resistance, to hold against the change of stored energy."""
    pack = problem.battery
    _, voltage, discharge, charge = battery_model.states(pack, energy_j[:-1])
    resistance = np.where(power_w < 0, charge, discharge)
    current = battery_model.source_power_w(power_w, voltage, resistance)[0] / voltage
    coulombic = (1 - pack.coulombic_efficiency) * np.maximum(-voltage * current, 0.0)
    return {
        "battery_chemical_w": -np.diff(energy_j) / problem.table.step_s,
        "battery_loss_w": resistance * current**2 + coulombic,
        "battery_voltage_v": voltage - resistance * current,
        "battery_current_a": current,
    }


def _residuals(table: ControlTable, f: Mapping[str, Array], power_w: Array) -> dict[str, Array]:
    """Power in less power out less loss, component by component."""
    residuals = {"battery": f["battery_chemical_w"] - power_w - f["battery_loss_w"]}
    if not table.flows:
        return residuals
    engine_w = f["engine_torque_nm"] * f["engine_speed_radps"]
    inertia_w = f["engine_inertia_w"] + f["machine_inertia_w"]
    lost_w = f["clutch_loss_w"] + f["gearbox_loss_w"] + f["gear_loss_w"] + f["brake_power_w"]
    return residuals | {
        "engine": f["fuel_power_w"] - engine_w - f["engine_loss_w"],
        "machines": f["machine_electric_w"] - f["machine_power_w"] - f["machine_loss_w"],
        "driveline": engine_w + f["machine_power_w"] - inertia_w - lost_w - f["wheel_power_w"],
        "electric bus": power_w - f["machine_electric_w"] - f["auxiliary_power_w"],
        "whole car": f["fuel_power_w"]
        + f["battery_chemical_w"]
        - f["wheel_power_w"]
        - f["auxiliary_power_w"]
        - inertia_w
        - f["engine_loss_w"]
        - lost_w
        - f["machine_loss_w"]
        - f["battery_loss_w"],
    }
