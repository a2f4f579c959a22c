"""What the pages of driven cars draw, as plain lists: a run thinned out over time, forces over speed."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from hevopt.forward import _pull_kernels as pull
from hevopt.forward.performance import STEP_S, Performance
from hevopt.forward.run import ForwardRun
from hevopt.output.driven_tables import audit
from hevopt.problem.arrays import Array
from hevopt.units import KMH_PER_MPS, RPM_PER_RADPS, STANDARD_GRAVITY_MPS2

POINTS_MAX = 2400
TOLERANCE_KMH, TOLERANCE_S = 2.0, 1.0
SLOPES = (0.0, 0.05, 0.10, 0.20, 0.30)
_PULL_POINTS = 600
# What the clutch loses by cause, and a torque converter beside it.
_LOSSES = {cause: f"clutch_{cause}_w" for cause in ("launch", "change", "start", "other")}
_LOSSES["converter"] = "torque_converter_loss_w"


def drawn_run(run: ForwardRun) -> dict[str, Any]:
    """A run over time. States at the ends of stretches of steps, powers and torques as their means."""
    steps = len(run.gear)
    every = max(-(-steps // POINTS_MAX), 1)
    ends = np.append(np.arange(every, steps, every), steps)
    counts = np.diff(np.append(0, ends))

    def mean(values: Array) -> list[float | None]:
        sums = np.add.reduceat(np.nan_to_num(values), np.append(0, ends[:-1]))
        return _rounded(sums / counts)

    flows, pack = run.books.flows, run.car.battery
    low, high = tolerance_band(run)
    return {
        "t": _rounded(run.time_s[ends]),
        "wanted": _rounded(run.wanted_mps[ends] * KMH_PER_MPS),
        "speed": _rounded(run.speed_mps[ends] * KMH_PER_MPS),
        "low": _rounded(low[ends]),
        "high": _rounded(high[ends]),
        "gear": run.gear[ends - 1].tolist(),
        "rpm": mean(flows["engine_speed_radps"] * RPM_PER_RADPS),
        "engine": mean(flows["engine_torque_nm"]),
        "machines": [
            [name.replace("_", " "), mean(flows[f"{name}_torque_nm"])]
            for name, _ in run.car.driveline.machines
        ],
        "clutch": {
            name: mean(flows[flow] / 1e3) for name, flow in _LOSSES.items() if flow in flows
        },
        "brakes": mean(flows["brake_power_w"] / 1e3),
        "soc": _rounded(100 * run.soc[ends], 4),
        "plan": _rounded(100 * _soc_of(run, run.planned_j[ends]), 4),
        "window": [100 * pack.soc_min, 100 * pack.soc_max],
        "outside": [[v.start_s, v.start_s + v.duration_s] for v in run.quality.violations],
        "audit": [[name, value / 1e3] for name, value in audit(run).items()],
    }


def tolerance_band(run: ForwardRun) -> tuple[Array, Array]:
    """(step + 1,) lowest and highest speed, km/h, within the tolerance of the wanted trace."""
    reach = round(TOLERANCE_S / run.step_s)
    wanted = run.wanted_mps * KMH_PER_MPS
    low, high = (_extreme(sign * wanted, reach) * sign for sign in (-1.0, 1.0))
    return np.maximum(low - TOLERANCE_KMH, 0.0), high + TOLERANCE_KMH


def _extreme(values: Array, reach: int) -> Array:
    """Highest of the neighbours on both sides."""
    from scipy.ndimage import maximum_filter1d

    return np.asarray(maximum_filter1d(values, 2 * reach + 1, mode="nearest"))


def _soc_of(run: ForwardRun, energy_j: Array) -> Array:
    from hevopt.problem.battery import soc

    return np.asarray(soc(run.car.battery, energy_j))


def drawn_performance(found: Sequence[Performance]) -> dict[str, Any]:
    """Forces over speed and the run from rest of every car."""
    return {"cars": [_drawn(of) for of in found]}


def _drawn(of: Performance) -> dict[str, Any]:
    curves, trace = of.curves, of.trace
    speed = curves.speed_mps * KMH_PER_MPS
    weight = of.car.vehicle.mass_kg * STANDARD_GRAVITY_MPS2
    some, thin = slice(None, None, 6), slice(None, None, max(len(trace) // _PULL_POINTS, 1))
    accel = np.gradient(trace[:, pull.SPEED], STEP_S)
    at_s: Array = np.linspace(STEP_S, STEP_S * len(trace), len(trace))
    return {
        "name": of.name,
        "speed": _rounded(speed[some]),
        "forces": [_rounded(force[some] / 1e3) for force in curves.by_gear_n],
        "against": [
            [slope, _rounded((curves.resistance_n + weight * np.sin(np.arctan(slope)))[some] / 1e3)]
            for slope in SLOPES
        ],
        "grip": curves.grip_n / 1e3,
        "t": _rounded(at_s[thin]),
        "kmh": _rounded(trace[thin, pull.SPEED] * KMH_PER_MPS),
        "accel": _rounded(accel[thin]),
        "gear": (trace[thin, pull.GEAR] + 1).astype(int).tolist(),
    }


def _rounded(values: Array, digits: int = 3) -> list[float | None]:
    """Plain numbers; what is not there is null in JSON."""
    return [None if np.isnan(v) else round(float(v), digits) for v in values]
