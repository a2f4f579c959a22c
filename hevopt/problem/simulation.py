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
from hevopt.problem.late import Late
from hevopt.problem.problem import Problem, Trajectory
from hevopt.problem.reject import REJECT_WORDS
from hevopt.problem.switching import switched
from hevopt.problem.table import ControlTable


def simulate(problem: Problem, control: ArrayLike) -> Trajectory:
    """The trajectory of control indices, (time,).

    Raises InfeasibleError at the first step whose control is no index or rejected, whose switch is forbidden or
    whose charge leaves the window.
    """
    table = problem.table
    control = _indices(table, control)
    steps = np.arange(len(control))
    switch = switched(table, problem.start_mode, control)
    if not switch.allowed.all():
        k = int(np.argmin(switch.allowed))
        raise InfeasibleError(
            f"forbidden switch from mode {switch.before[k]} to {switch.mode[k]} at step {k} "
            f"(t = {table.time_s[k]:g} s)"
        )
    power_w = table.battery_power_w[steps, control]
    arrays = problem.battery.arrays
    energy_j = trace(problem.start_j, switch.energy_j, power_w, table.step_s, arrays)
    _check_window(problem, energy_j, switch.energy_j)
    fuel_kg = table.fuel_kg[steps, control] + switch.kg
    nox_kg = table.nox_kg[steps, control]

    def worked_out() -> dict[str, Array]:
        between_j = energy_j[:-1] - switch.energy_j
        return cast(Flows, table.flows).along(control) | battery_model.step_flows(
            problem.battery, between_j, energy_j[1:], power_w, table.step_s
        )

    flows = Late(worked_out)
    return Trajectory(
        problem=problem,
        control=control,
        energy_j=energy_j,
        soc=battery_model.soc(problem.battery, energy_j),
        mode=switch.mode,
        fuel_kg=fuel_kg,
        switch_fuel_kg=switch.kg,
        switch_energy_j=switch.energy_j,
        nox_kg=nox_kg,
        battery_power_w=power_w,
        cost_kg=float(np.sum(problem.cost_kg[steps, control] + switch.kg)),
        flows=flows,
        residuals=Late(lambda: _residuals(table, flows, power_w, switch.energy_j)),
    )


def total_cost_kg(problem: Problem, control: Indices) -> tuple[float, Array]:
    """Cost and stored energy of control indices, without the checks: for searches inside strategies."""
    table = problem.table
    steps = np.arange(len(control))
    switch = switched(table, problem.start_mode, control)
    cost = np.sum(problem.cost_kg[steps, control] + switch.kg)
    power_w = table.battery_power_w[steps, control]
    arrays = problem.battery.arrays
    return float(cost), trace(problem.start_j, switch.energy_j, power_w, table.step_s, arrays)


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


def _check_window(problem: Problem, energy_j: Array, switch_j: Array) -> None:
    """InfeasibleError where a plan leaves the window first, between switching and step or after a step."""
    low, high = problem.battery.granted_window_j
    points = np.empty((len(switch_j), 2))
    points[:, 0], points[:, 1] = energy_j[:-1] - switch_j, energy_j[1:]
    inside = (points >= low) & (points <= high)
    if inside.all():
        return
    k, after = divmod(int(np.argmin(inside.ravel())), 2)
    found = "more than the battery's voltage can deliver"
    if np.isfinite(points[k, after]):
        found = f"SOC {float(battery_model.soc(problem.battery, points[k, after])):.4f}"
    where = "after" if after else f"where switching takes {switch_j[k]:.6g} J, before"
    raise InfeasibleError(
        f"{found} {where} step {k} (t = {problem.table.time_s[k]:g} s); allowed: "
        f"{problem.battery.soc_min:g} to {problem.battery.soc_max:g}"
    )


def _residuals(
    table: ControlTable, f: Mapping[str, Array], power_w: Array, switch_j: Array
) -> dict[str, Array]:
    """Power in less power out less loss, component by component; that of shafts between and within the steps."""
    residuals = {"battery": f["battery_chemical_w"] - power_w - f["battery_loss_w"]}
    if not table.flows:
        return residuals
    engine_w = f["engine_torque_nm"] * f["engine_speed_radps"]
    converter_w = f["converter_loss_w"] if "converter_loss_w" in f else np.zeros_like(power_w)
    inertia_w = f["engine_inertia_w"] + f["machine_inertia_w"]
    lost_w = f["clutch_loss_w"] + f["gearbox_loss_w"] + f["gear_loss_w"] + f["brake_power_w"]
    switched_w = spun_w = np.zeros_like(power_w)
    if "shafts_start_j" in f:
        within_w = (f["shafts_end_j"] - f["shafts_start_j"]) / table.step_s
        between_w = (f["shafts_start_j"] - f["shafts_before_j"]) / table.step_s
        switched_w = (f["spin_fuel_j"] + switch_j - f["spin_loss_j"]) / table.step_s
        spun_w = between_w
        residuals |= {"shafts": within_w - inertia_w, "switching": switched_w - between_w}
    return residuals | {
        "engine": f["fuel_power_w"] - engine_w - f["engine_loss_w"],
        "machines": f["machine_electric_w"] - f["machine_power_w"] - f["machine_loss_w"],
        "driveline": engine_w + f["machine_power_w"] - inertia_w - lost_w - f["wheel_power_w"],
        "electric bus": power_w - converter_w - f["machine_electric_w"] - f["auxiliary_power_w"],
        "whole car": f["fuel_power_w"]
        + f["battery_chemical_w"]
        - f["wheel_power_w"]
        - f["auxiliary_power_w"]
        - inertia_w
        - f["engine_loss_w"]
        - lost_w
        - f["machine_loss_w"]
        - f["battery_loss_w"]
        - converter_w
        + switched_w
        - spun_w,
    }
