"""Random small problems of the kinds that break proofs.

Window ends that are points of the curves with a steep rise beyond; curves bent inside the window, up or down;
flat ones; resistances that rise or fall with charge, or are 0; limits of power and current that bite; powers at
the voltage's peak; scales of cost, voltage and energy over many orders; ties, costs of 0 and below, switches that
are dear, forbidden or free, fuel for staying in a mode, several modes, steps that move a good part of the window or
hundreds of them. Switches that take stored energy or give it back, from nothing to more than the window, alike at
every step or not.
"""

from dataclasses import replace

import numpy as np

from hevopt import Battery, Control, ControlTable, Problem

_CURVES = ("kinked", "ends", "bent", "flat", "line", "steep")


def draw(seed: int) -> Problem:
    """Problem `seed`: 2 to 5 steps, 2 to 4 controls, 1 to 3 modes."""
    rng = np.random.default_rng([11, seed])
    steps, count, modes = int(rng.integers(2, 6)), int(rng.integers(2, 5)), int(rng.integers(1, 4))
    power_w = float(10 ** (rng.uniform(-9, 6) if rng.random() < 0.3 else 3))
    step_s = rng.uniform(0.5, 1.5, steps) * float(rng.choice([1.0, 1.0, 1.0, 10.0, 100.0]))
    tied = rng.random() < 0.25
    if tied:
        step_s = np.full(steps, step_s[0])
    battery = _battery(rng, power_w, float(step_s.mean()), tied)
    table = _table(rng, battery, step_s, count, modes, power_w, tied)
    table = _with_switching(np.random.default_rng([12, seed]), table, power_w)
    low, high = battery.soc_min, battery.soc_max
    start = float(rng.choice([low, high, rng.uniform(low, high)], p=[0.1, 0.1, 0.8]))
    end = start + (high - low) * float(rng.choice([0.0, rng.uniform(-0.4, 0.2)]))
    start_mode = int(rng.integers(0, modes))
    weight = float(rng.choice([0.0, 0.0, 5.0]))
    return Problem(table, battery, start, min(max(end, low), high), start_mode, weight)


def _with_switching(rng, table, power_w) -> ControlTable:
    """Energy of switching in half of the problems, figures that depend on the step in some."""
    whole = len(table.step_s), table.modes, table.modes
    energy = rng.uniform(-1, 1, whole if rng.random() < 0.5 else whole[1:])
    if rng.random() < 0.2:
        energy = np.round(energy)
    if rng.random() < 0.9:
        energy = energy * (1 - np.eye(table.modes))
    share = float(rng.choice([0.0, 0.01, 0.3, 1.0, 5.0], p=[0.5, 0.1, 0.2, 0.15, 0.05]))
    parts = {"switch_energy_j": energy * share * power_w * float(table.step_s.mean())}
    if rng.random() < 0.2:
        parts["switch_fuel_kg"] = table.switch_fuel_kg * rng.uniform(0, 2, whole)
    if rng.random() < 0.1:
        kg = parts.get("switch_fuel_kg", table.switch_fuel_kg)
        parts["switch_fuel_kg"] = kg + np.eye(table.modes) * rng.uniform(0, 2) * kg.max()
    if rng.random() < 0.1:
        forbidden = (rng.random(whole) < 0.2) & ~np.eye(table.modes, dtype=bool)
        parts["switch_allowed"] = table.switch_allowed & ~forbidden
    return replace(table, **parts)


def _battery(rng, power_w, step_s, tied) -> Battery:
    kind = rng.choice(_CURVES)
    low, high = sorted(rng.uniform(0.1, 0.9, 2))
    high = max(high, low + 0.05)
    soc = {
        "kinked": [0.0, low, high, 1.0],
        "steep": [0.0, low, high, 1.0],
        "ends": [0.0, low, rng.uniform(low + 0.01, high - 0.01), high, 1.0],
        "bent": [0.0, 0.3, 0.5, 0.7, 1.0],
        "flat": [0.0, 1.0],
        "line": [0.0, 1.0] if rng.random() < 0.5 else [0.0, low, 1.0],
    }[kind]
    soc = np.array(soc)
    rise = rng.uniform(0, 1, len(soc) - 1) * {"flat": 0.0, "steep": 1.5}.get(kind, 0.5)
    if kind == "line":
        rise = np.diff(soc) * rng.uniform(0, 1)
    if kind == "steep":
        rise[-1] *= 20
    unit_v = float(10 ** (rng.uniform(-3, 3) if rng.random() < 0.3 else 1))
    voltage = unit_v * (1 + np.concatenate([[0.0], np.cumsum(rise)]))
    at_peak = rng.choice([1.0, 2.0, 4.0, 20.0], p=[0.1, 0.3, 0.4, 0.2])
    ohm = voltage[0] ** 2 / 4 / power_w / at_peak
    constant = rng.random() < 0.5
    resistances = [ohm * _shape(rng, len(soc), constant) for _ in range(2)]
    if rng.random() < 0.2 or tied:
        resistances = [np.zeros(len(soc))] * 2
    content_j = power_w * step_s * rng.uniform(1, 6)
    limits = {}
    for name, unit in (("power", power_w), ("current", power_w / voltage[0])):
        for way in ("discharge", "charge"):
            if rng.random() < 0.15:
                suffix = "w" if name == "power" else "a"
                limits[f"{name}_max_{way}_{suffix}"] = unit * rng.uniform(0.4, 1.5)
    return Battery(
        soc, voltage, *resistances, content_j / (high - low) / voltage[0],
        1.0 if tied else rng.uniform(0.8, 1.0), float(low), float(high), **limits,
    )  # fmt: skip


def _shape(rng, points, constant):
    values = rng.uniform(0.1, 1.0, points)
    if constant:
        return np.full(points, values[0])
    kind = rng.choice(["rising", "falling", "any"])
    return {"rising": np.sort(values), "falling": np.sort(values)[::-1]}.get(kind, values)


def _table(rng, battery, step_s, count, modes, power_w, tied) -> ControlTable:
    shape = len(step_s), count
    power = rng.uniform(-1, 1, shape) * power_w
    if tied:
        power = power_w * rng.integers(-2, 3, shape) / 2
    if rng.random() < 0.1:
        power[rng.random(shape) < 0.2] *= 300.0
    if rng.random() < 0.1 and battery.discharge_ohm.max() > 0:
        # To the last bit the most that the lowest voltage can deliver.
        peak = battery.open_circuit_v[0] ** 2 / (4 * battery.discharge_ohm.max())
        power[rng.random(shape) < 0.2] = peak
    unit_kg = float(10 ** (rng.uniform(-9, 6) if rng.random() < 0.3 else -3))
    fuel = np.maximum(0.2 - 0.15 * np.clip(power / power_w, -1, 1), 0.0)
    fuel += rng.uniform(-0.05, 0.05, shape)
    cost = str(
        rng.choice(["plain", "zero", "tied", "negative", "dear"], p=[0.6, 0.1, 0.1, 0.1, 0.1])
    )
    if cost == "zero":
        fuel = np.zeros(shape)
    elif cost == "tied":
        fuel = np.round(np.maximum(fuel, 0.0), 1)
    elif cost == "negative":
        fuel -= rng.uniform(0, 0.3)
    else:
        fuel = np.maximum(fuel, 0.0)
    if cost == "dear":
        fuel[rng.random(shape) < 0.1] *= 1e6
    mode = rng.integers(0, modes, count)
    switch = rng.uniform(0, 1, (modes, modes)) * (1 - np.eye(modes))
    switch *= float(rng.choice([0.0, 0.1, 0.5, 10.0, 1e4]))
    allowed = (rng.random((modes, modes)) > 0.15) | np.eye(modes, dtype=bool)
    reject = (rng.random(shape) < 0.1).astype(np.uint16)
    return ControlTable(
        time_s=np.cumsum(step_s) - step_s,
        step_s=step_s,
        fuel_kg=fuel * unit_kg,
        nox_kg=np.abs(fuel) * unit_kg * rng.uniform(0, 0.02, shape),
        battery_power_w=power,
        reject=reject,
        mode=mode,
        switch_fuel_kg=switch * unit_kg,
        switch_allowed=allowed,
        controls=tuple(Control(bool(m), 0, str(c)) for c, m in enumerate(mode)),
    )
