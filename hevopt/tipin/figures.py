"""The figures of a tip-in, with their definitions.

Time 0 is when the pedal begins to move, at 10/s to the floor: ratios before 0.3 s compare two ramps.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hevopt.mean_value import states as s
from hevopt.mean_value.car import settled_torque_nm
from hevopt.mean_value.parameters import FULL_LOAD, curve_of
from hevopt.mean_value.run import SAMPLE_S, Run

Array = NDArray[np.float64]

TIMES_S = (0.3, 0.5, 1.0, 2.0, 3.0)
GAINED_S, SETTLED_AT_S = 5.0, 3.0
_AFTER_RAMP_S, _NEARLY = 0.3, 0.9

DEFINITIONS = {
    "acceleration": "of the car, mean value and steady map, at times after the pedal begins to move",
    "ratio": "acceleration by the steady map over that by the mean-value model",
    "90 % of boost": "first time after 0.3 s at which intake pressure has made 90 % of the way from its start to "
    "the control unit's target at the engine speed of that moment",
    "90 % of torque": "first time after 0.3 s at which torque is 90 % of the file's full load at the engine speed "
    "of that moment",
    "gained": f"speed gained after {GAINED_S:g} s",
    "least lambda": "of the cylinders; the smoke limit holds where it sees their own air",
    "surge margin": "least flow over the flow at surge of the same speed line; 1 is surge",
    "settled": f"torque that full pedal settles to at the engine speed of {SETTLED_AT_S:g} s, over the file's full "
    "load; what a lean smoke limit takes for good is here, not in the lag",
    "torque hole": f"file's full load times pedal, less torque, where above 0, over {GAINED_S:g} s; times "
    "engine speed as energy",
}


@dataclass(frozen=True, slots=True)
class Start:
    """The constant speed before: it decides how the first second goes."""

    engine_radps: float
    turbo_radps: float
    boost_pa: float
    pedal: float
    egr_share: float
    burnt_share: float
    vanes: float
    excess_air: float


@dataclass(frozen=True, slots=True)
class Figures:
    """What a tip-in comes to; accelerations and ratios at TIMES_S. None: not within the run."""

    start: Start
    accel_mps2: tuple[float, ...]
    map_accel_mps2: tuple[float, ...]
    ratio: tuple[float, ...]
    boost_90_s: float | None
    torque_90_s: float | None
    gained_mps: float
    map_gained_mps: float
    least_excess_air: float
    smoke_limited_s: float
    surge_margin: float
    turbo_max_radps: float
    exhaust_max_pa: float
    exhaust_max_k: float
    settled_share: float
    hole_nms: float
    hole_j: float
    hole_peak_w: float


def figures_of(run: Run, by_map: Run) -> Figures:
    """The figures of a run, beside the run of the same car by its steady map."""
    later = float(run.states[round(SETTLED_AT_S / SAMPLE_S), s.ENGINE])
    settled = settled_torque_nm(run.model, later)
    at = [round(time / SAMPLE_S) for time in TIMES_S]
    accel = tuple(float(run["accel_mps2"][k]) for k in at)
    by_map_accel = tuple(float(by_map["accel_mps2"][k]) for k in at)
    end = round(GAINED_S / SAMPLE_S)
    missing = np.maximum(run["full_load_nm"] * run["pedal"] - run["torque_nm"], 0.0)[: end + 1]
    power = missing * run.states[: end + 1, s.ENGINE]
    return Figures(
        start=_start(run),
        accel_mps2=accel,
        map_accel_mps2=by_map_accel,
        ratio=tuple(m / a for m, a in zip(by_map_accel, accel, strict=True)),
        boost_90_s=_reached(run, boost_share(run)),
        torque_90_s=_reached(run, run["torque_nm"] / run["full_load_nm"]),
        gained_mps=float(run.states[end, s.ROAD] - run.states[0, s.ROAD]),
        map_gained_mps=float(by_map.states[end, s.ROAD] - by_map.states[0, s.ROAD]),
        least_excess_air=float(run["excess_air"].min()),
        smoke_limited_s=float((run["allowed_kg"] < run["demanded_kg"]).sum() * SAMPLE_S),
        surge_margin=float((run["flow_number"] / run["surge_number"]).min()),
        turbo_max_radps=float(run.states[:, s.TURBO].max()),
        exhaust_max_pa=float(run["p4_pa"].max()),
        exhaust_max_k=float(run["t4_k"].max()),
        settled_share=settled / float(np.interp(later, *curve_of(run.model.curves, FULL_LOAD))),
        hole_nms=integral(missing),
        hole_j=integral(power),
        hole_peak_w=float(power.max()),
    )


def boost_share(run: Run) -> Array:
    """(sample,) way from the first intake pressure to the target that has been made."""
    first = run["p3_pa"][0]
    share: Array = (run["p3_pa"] - first) / np.maximum(run["target_pa"] - first, 1.0)
    return share


def integral(values: Array) -> float:
    """Integral over time of values per sample."""
    return float(np.trapezoid(values, dx=SAMPLE_S))


def _start(run: Run) -> Start:
    y = run.states[0]
    return Start(
        engine_radps=float(y[s.ENGINE]),
        turbo_radps=float(y[s.TURBO]),
        boost_pa=float(run["p3_pa"][0]),
        pedal=float(y[s.PEDAL]),
        egr_share=float(run["egr_kgps"][0] / run["into_cylinders_kgps"][0]),
        burnt_share=float(run["burnt_3"][0]),
        vanes=float(y[s.VANES]),
        excess_air=float(run["excess_air"][0]),
    )


def _reached(run: Run, share: Array) -> float | None:
    there = np.flatnonzero((share >= _NEARLY) & (run.time_s >= _AFTER_RAMP_S))
    if not len(there):
        return None
    k = int(there[0])
    if share[k - 1] >= _NEARLY:
        return float(run.time_s[k])
    part = (_NEARLY - share[k - 1]) / (share[k] - share[k - 1])
    return float(run.time_s[k - 1] + part * SAMPLE_S)
