"""The exported table is enough for somebody else's solver: one that shares no code with hevopt."""

import numpy as np
import pytest

from hevopt import simulate
from hevopt.cli import main
from hevopt.strategies import STRATEGIES


def export(tmp_path, monkeypatch, car):
    path = tmp_path / "t.npz"
    monkeypatch.setattr("sys.argv", ["hevopt", "table", car, "--out", str(path)])
    with pytest.raises(SystemExit) as stop:
        main()
    assert stop.value.code == 0
    with np.load(path) as contents:
        return {name: contents[name] for name in contents.files}


def their_step(t, energy, power, step):
    """Battery step as the file's README entry describes it, for a battery of two points."""
    volts, soc = t["battery_open_circuit_v"], t["battery_soc"]
    slope = (volts[1] - volts[0]) / (soc[1] - soc[0])
    voltage = np.sqrt(volts[0] ** 2 + 2 * slope * energy / t["battery_capacity_as"])
    ohm = np.where(power > 0, t["battery_discharge_ohm"][0], t["battery_charge_ohm"][0])
    current = 2 * power / (voltage + np.sqrt(voltage**2 - 4 * ohm * power))
    efficiency = np.where(current < 0, t["battery_coulombic_efficiency"], 1.0)
    return energy - step * voltage * current * efficiency


def theirs(t, name, k):
    """(mode, mode) of what switching takes at a step."""
    return t[name] if t[name].ndim == 2 else t[name][k]


def their_dp(t, nodes):
    """Plain value iteration over stored energy: forward step, np.interp, loops over time and control."""

    def stored(soc):
        low, high = t["battery_open_circuit_v"]
        return t["battery_capacity_as"] * (low * soc + (high - low) * soc**2 / 2)

    grid = np.linspace(stored(t["soc_min"]), stored(t["soc_max"]), nodes)
    modes, end = t["switch_fuel_kg"].shape[-1], stored(t["soc_end_min"])
    value = np.tile(1e-6 * np.maximum(end - grid, 0), (modes, 1))
    values = [value]
    for k in range(len(t["time_s"]) - 1, -1, -1):
        least = np.full((modes, nodes), 1e3)
        for c in np.flatnonzero(t["feasible"][k]):
            after = their_step(t, grid, t["battery_power_w"][k, c], t["step_s"][k])
            total = t["fuel_kg"][k, c] + np.interp(after, grid, value[t["mode"][c]])
            total += 1e-6 * np.maximum(grid[0] - after, 0)
            least[t["mode"][c]] = np.minimum(least[t["mode"][c]], total)
        kg, joule = theirs(t, "switch_fuel_kg", k), theirs(t, "switch_energy_j", k)
        value = np.array([
            np.min([kg[m, n] + np.interp(grid - joule[m, n], grid, least[n]) for n in range(modes)], axis=0)
            for m in range(modes)
        ])  # fmt: skip
        values.append(value)
    return their_rollout(t, grid, values[::-1], stored(t["soc_start"]))


def their_rollout(t, grid, values, energy):
    fuel, mode, chosen = 0.0, int(t["start_mode"]), []
    for k in range(len(t["time_s"])):
        usable = np.flatnonzero(t["feasible"][k])
        to = t["mode"][usable]
        between = energy - theirs(t, "switch_energy_j", k)[mode, to]
        after = their_step(t, between, t["battery_power_w"][k, usable], t["step_s"][k])
        ahead = [
            np.interp(e, grid, values[k + 1][t["mode"][c]])
            for e, c in zip(after, usable, strict=True)
        ]
        cost = t["fuel_kg"][k, usable] + theirs(t, "switch_fuel_kg", k)[mode, to]
        best = int(np.argmin(cost + np.array(ahead)))
        fuel, energy, mode = fuel + cost[best], after[best], int(t["mode"][usable[best]])
        chosen.append(usable[best])
    return fuel, energy, np.array(chosen)


def test_somebody_elses_dp_on_the_exported_table_agrees_with_ours(
    tmp_path, monkeypatch, problem_of
):
    problem = problem_of("C1", "nedc")
    fuel, energy, chosen = their_dp(export(tmp_path, monkeypatch, "C1"), 301)
    judged = simulate(problem, chosen)
    assert judged.total_fuel_kg == pytest.approx(fuel, rel=1e-12)
    assert judged.end_j == pytest.approx(energy, rel=1e-12)
    ours = simulate(problem, STRATEGIES["dp"].solve(problem).control)
    assert ours.total_fuel_kg <= fuel * (1 + 1e-9)
    assert ours.total_fuel_kg == pytest.approx(fuel, rel=5e-3)


def test_the_file_documents_its_arrays(tmp_path, monkeypatch):
    contents = export(tmp_path, monkeypatch, "B")
    readme = str(contents["README"])
    for name in contents:
        assert name == "README" or name in readme, name
    needed = "fuel_kg nox_kg battery_power_w feasible mode switch_fuel_kg switch_allowed time_s"
    assert set(needed.split()) <= set(contents)
    assert contents["fuel_kg"].shape == contents["feasible"].shape
