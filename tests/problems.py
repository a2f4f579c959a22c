"""Small problems made from arrays, and their exact solution by trying every plan.

The enumeration does not use hevopt's battery or simulation: it has its own scalar battery step.
"""

from dataclasses import replace

import numpy as np

from hevopt import Battery, Control, ControlTable, Problem
from hevopt.problem.table import Signals


def random_battery(rng: np.random.Generator, curved: bool) -> Battery:
    """A small pack; curved: voltage and resistances over SOC in three segments, else linear voltage."""
    points = np.array([0.0, 0.35, 0.6, 1.0]) if curved else np.array([0.0, 1.0])
    voltage = np.cumsum(
        np.concatenate([[rng.uniform(80, 120)], rng.uniform(0, 30, len(points) - 1)])
    )
    scale = 0.5 * voltage[0] ** 2 / 4 / 2500.0
    shape = len(points) if curved else 1
    discharge, charge = (
        np.broadcast_to(rng.uniform(0.1, 1.0, shape) * scale, points.shape) for _ in range(2)
    )
    return Battery(
        points, voltage, discharge, charge, rng.uniform(60, 200), rng.uniform(0.8, 1.0), 0.2, 0.9
    )


def random_problem(seed: int, most: int = 4) -> Problem:
    """At most 6 steps, 3 modes, `most` controls; random switching, some forbidden; every second battery curved."""
    rng = np.random.default_rng(seed)
    steps, controls, modes = rng.integers(2, 7), rng.integers(2, most + 1), rng.integers(1, 4)
    power = rng.uniform(-1500, 1500, (steps, controls))
    fuel = np.maximum(0.2 - 1e-4 * power + rng.uniform(-0.05, 0.05, power.shape), 0.0) * 1e-3
    mode = np.sort(rng.integers(0, modes, controls))
    switch = rng.uniform(0, 1.5e-4, (modes, modes)) * (1 - np.eye(modes))
    allowed = (rng.random((modes, modes)) > 0.15) | np.eye(modes, dtype=bool)
    reject = (rng.random(power.shape) < 0.1).astype(np.uint16)
    reject[np.arange(steps), rng.integers(0, controls, steps)] = 0
    battery = random_battery(rng, curved=bool(seed % 2))
    step_s = rng.uniform(0.5, 1.5, steps)
    table = ControlTable(
        time_s=np.concatenate([[0.0], np.cumsum(step_s)[:-1]]),
        step_s=step_s,
        fuel_kg=fuel,
        nox_kg=fuel * rng.uniform(0, 0.02, fuel.shape),
        battery_power_w=power,
        reject=reject,
        mode=mode,
        switch_fuel_kg=switch,
        switch_allowed=allowed,
        controls=tuple(Control(bool(m), 0, str(c)) for c, m in enumerate(mode)),
    )
    start = rng.uniform(0.4, 0.7)
    weight = 5.0 if seed % 3 == 0 else 0.0
    return Problem(table, battery, start, start + rng.uniform(-0.15, 0.05), 0, weight)


def every_plan(problem: Problem) -> tuple[np.ndarray, np.ndarray]:
    """Cost and stored energy at the end of every plan that keeps to controls, switches and window."""
    table, low_high = problem.table, problem.window_j
    cost, energy = np.zeros(1), np.array([problem.start_j])
    mode = np.array([problem.start_mode])
    for k in range(len(table.step_s)):
        parts = []
        for c in np.flatnonzero(table.reject[k] == 0):
            after = energy - table.step_s[k] * _drain_w(
                problem.battery, table.battery_power_w[k, c], energy
            )
            ok = table.switch_allowed[mode, table.mode[c]]
            ok = ok & (after >= low_high[0] - 1e-9) & (after <= low_high[1] + 1e-9)
            step_cost = table.fuel_kg[k, c] + problem.nox_weight * table.nox_kg[k, c]
            total = cost + step_cost + table.switch_fuel_kg[mode, table.mode[c]]
            parts.append((total[ok], after[ok], np.full(ok.sum(), table.mode[c])))
        cost, energy, mode = (np.concatenate(column) for column in zip(*parts, strict=True))
    return cost, energy


def _drain_w(pack: Battery, power: float, energy: np.ndarray) -> np.ndarray:
    """Fall of stored energy by charge: I from the quadratic, SOC from E = Q times the area under Uoc."""
    areas = np.diff(pack.soc) * (pack.open_circuit_v[1:] + pack.open_circuit_v[:-1]) / 2
    points = np.concatenate([[0.0], np.cumsum(areas)]) * pack.capacity_as
    result = np.empty_like(energy)
    for n, stored in enumerate(energy):
        i = min(int(np.sum(stored >= points[1:])), len(points) - 2)
        a = (
            (pack.open_circuit_v[i + 1] - pack.open_circuit_v[i])
            / (pack.soc[i + 1] - pack.soc[i])
            / 2
        )
        b, c = pack.open_circuit_v[i], -(stored - points[i]) / pack.capacity_as
        step = -c / b if a == 0 else (-b + np.sqrt(b * b - 4 * a * c)) / (2 * a)
        soc = pack.soc[i] + step
        volt = np.interp(soc, pack.soc, pack.open_circuit_v)
        ohm = np.interp(soc, pack.soc, pack.charge_ohm if power < 0 else pack.discharge_ohm)
        current = (volt - np.sqrt(volt**2 - 4 * ohm * power)) / (2 * ohm)
        result[n] = volt * current * (pack.coulombic_efficiency if current < 0 else 1.0)
    return result


def switching_rows(table: ControlTable, order: np.ndarray | slice) -> dict[str, np.ndarray]:
    """What switching takes in some steps of a table, by the names of its fields."""
    names = ("switch_fuel_kg", "switch_energy_j", "switch_allowed")
    matrices = {name: getattr(table, name) for name in names}
    return {name: m if m.ndim == 2 else m[order] for name, m in matrices.items()}


def rows(problem: Problem, order: np.ndarray) -> Problem:
    """The problem with other rows, in the order given; start times and missing torque left out of it."""
    table = problem.table
    fields = ("speed_mps", "wheel_power_w", "gear", "clutch_open")
    step_s = table.step_s[order]
    changed = replace(
        table,
        time_s=np.cumsum(step_s) - step_s,
        step_s=step_s,
        fuel_kg=table.fuel_kg[order],
        nox_kg=table.nox_kg[order],
        battery_power_w=table.battery_power_w[order],
        reject=table.reject[order],
        **switching_rows(table, order),
        signals=Signals(*(getattr(table.signals, name)[order] for name in fields)),
        flows={},
        missing_torque_nm=None,
    )
    return replace(problem, table=changed)
