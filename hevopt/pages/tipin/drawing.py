"""What the page of tip-ins draws, as numbers: traces over time, the compressor's map, torque over engine speed."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hevopt.mean_value import states as s
from hevopt.mean_value.car import BENCH, model_of
from hevopt.mean_value.compressor_map import islands, speed_line
from hevopt.mean_value.full_load import full_load
from hevopt.mean_value.parameters import FULL_LOAD, SMOKE, Ambient, Gas, curve_of
from hevopt.mean_value.run import SAMPLE_S, Run
from hevopt.tipin.drive import Manoeuvre, TipIn
from hevopt.units import KMH_PER_MPS, RPM_PER_RADPS

Array = NDArray[np.float64]

DRAWN_MAX = 24
_FINE_S, _LAST_S = 1.0, 6.0
_FINE, _COARSE = 2, 8
_LEVELS = (0.50, 0.55, 0.60, 0.65, 0.68, 0.70)
_LINES_KRPM = (60, 80, 100, 120, 140, 160, 180, 200, 220)
_MARKED_S = (0.0, 0.5, 1.0, 2.0, 3.0, 5.0)


def drawn(manoeuvre: Manoeuvre, found: Sequence[TipIn]) -> dict[str, Any]:
    """All that the page's script needs."""
    kept = found[:DRAWN_MAX]
    return {
        "cases": [_case(tip_in) for tip_in in kept],
        "map": _map(kept),
        "full_load": _full_load(manoeuvre, kept),
        "marked": list(_MARKED_S),
        "groups": _groups(kept),
    }


def _places(run: Run) -> NDArray[np.int64]:
    fine = round(_FINE_S / SAMPLE_S)
    last = min(len(run.time_s) - 1, round(_LAST_S / SAMPLE_S))
    return np.unique([*range(0, fine, _FINE), *range(fine, last + 1, _COARSE), last])


def _case(tip_in: TipIn) -> dict[str, Any]:
    run, k = tip_in.run, _places(tip_in.run)
    states, figures = run.states[k], tip_in.figures
    smoke = np.interp(states[:, s.ENGINE], *curve_of(run.model.curves, SMOKE))
    told = {
        "t": run.time_s[k],
        "accel": run["accel_mps2"][k],
        "map": tip_in.by_map["accel_mps2"][k],
        "speed": states[:, s.ROAD] * KMH_PER_MPS,
        "torque": run["torque_nm"][k],
        "full": run["full_load_nm"][k],
        "assist": _assist_nm(run)[k],
        "boost": run["p3_pa"][k] / 1e5,
        "target": run["target_pa"][k] / 1e5,
        "exhaust": run["p4_pa"][k] / 1e5,
        "turbo": states[:, s.TURBO] * RPM_PER_RADPS / 1e3,
        "lambda": run["excess_air"][k],
        "limit": smoke,
        "vanes": 100 * states[:, s.VANES],
        "vanes_asked": 100 * run["vanes_asked"][k],
        "egr": 100 * states[:, s.EGR],
        "air": 1e3 * run["air_kgps"][k],
        "returned": 1e3 * run["egr_kgps"][k],
        "kelvin": run["t4_k"][k],
        "rpm": states[:, s.ENGINE] * RPM_PER_RADPS,
        "flow": 1e3 * _corrected_flow(run)[k],
        "ratio": (run["p2_pa"] / run["p1_pa"])[k],
    }
    return {
        "label": tip_in.case.label,
        "boost_90": figures.boost_90_s,
        "torque_90": figures.torque_90_s,
        **{name: _rounded(values) for name, values in told.items()},
    }


def _assist_nm(run: Run) -> Array:
    """The machine's torque as if it stood on the crankshaft."""
    car = run.model.car
    share = car.assist_ratio_radpm * car.assist_efficiency / (car.ratio_radpm * car.efficiency)
    return run["assist_nm"] * share


def _corrected_flow(run: Run) -> Array:
    around = Ambient()
    ratio = np.sqrt(run["t1_k"] / around.temperature_k) * around.pressure_pa / run["p1_pa"]
    return run["compressor_kgps"] * ratio


def _map(found: Sequence[TipIn]) -> dict[str, Any]:
    wheel, gas, around = found[0].run.model.engine.compressor, Gas(), Ambient()
    fastest = max(tip_in.figures.turbo_max_radps for tip_in in found) * RPM_PER_RADPS / 1e3
    shown = [krpm for krpm in _LINES_KRPM if krpm < fastest + 30]
    lines = [speed_line(wheel, 1e3 * krpm / RPM_PER_RADPS, gas, around) for krpm in shown]
    slow = [
        speed_line(wheel, 1e3 * krpm / RPM_PER_RADPS, gas, around)
        for krpm in range(5, shown[-1] + 1, 5)
    ]
    return {
        "lines": [
            {"krpm": krpm, "flow": _rounded(1e3 * line.flow_kgps), "ratio": _rounded(line.ratio)}
            for krpm, line in zip(shown, lines, strict=True)
        ],
        "islands": [
            {
                "level": island.efficiency,
                "flow": _rounded(1e3 * island.flow_kgps),
                "ratio": _rounded(island.ratio),
            }
            for island in islands(wheel, 1e3 * shown[-1] / RPM_PER_RADPS, _LEVELS, gas, around)
        ],
        "surge": {
            "flow": _rounded(np.array([1e3 * line.flow_kgps[0] for line in slow])),
            "ratio": _rounded(np.array([line.ratio[0] for line in slow])),
        },
    }  # fmt: skip


def _full_load(manoeuvre: Manoeuvre, found: Sequence[TipIn]) -> dict[str, Any]:
    """The file's curve and the settled one, over the speeds that the tip-ins pass."""
    speeds, torques = curve_of(manoeuvre.diesel.curves, FULL_LOAD)
    last = max(float(tip_in.run.states[:, s.ENGINE].max()) for tip_in in found)
    passed = speeds[: int(np.searchsorted(speeds, last)) + 1]
    settled = full_load(model_of(manoeuvre.diesel, BENCH), passed)
    return {
        "rpm": _rounded(passed * RPM_PER_RADPS),
        "file": _rounded(torques[: len(passed)]),
        "settled": _rounded(settled["torque_nm"]),
    }


def _groups(found: Sequence[TipIn]) -> list[dict[str, Any]]:
    """Cases that vary the same: title, and their places among the drawn, the base first."""
    words = {
        "smoke": "smoke limit", "turbo_inertia": "inertia of the turbocharger", "final_drive": "final drive",
        "gear_ratio": "ratio of the gear", "egr": "recirculation before", "assist": "machine",
    }  # fmt: skip
    base, groups = found[0].case, []
    for name, title in words.items():
        places = [
            n for n, tip_in in enumerate(found) if getattr(tip_in.case, name) != getattr(base, name)
        ]
        if places:
            groups.append({"title": title, "cases": [0, *places]})
    return groups


def _rounded(values: Array) -> list[float | None]:
    return [float(f"{value:.5g}") if np.isfinite(value) else None for value in values]
