"""Standing still as a noisy sensor shows it: slow for a while, never quite 0, so that no engine would be stopped.

Where the user says below which speed the car counts as standing, every stretch of samples below it that lasts
3 s or longer is set to 0. Where not, stretches that look so are told and left as they are.
"""

import re
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from hevopt.errors import DataError
from hevopt.files.shown import shown
from hevopt.measured.cycles.columns import Drive
from hevopt.units import KMH_PER_MPS, unit_named

Array = NDArray[np.float64]

_STANDING_S = 3.0
_LIMIT_MAX_MPS = 5 / KMH_PER_MPS
# What is told of without being asked: slower than this for so long, and less than half of it at rest.
_SUSPECT_MPS, _SUSPECT_S, _SUSPECT_REST = 1 / KMH_PER_MPS, 5.0, 0.5
_SPEED = re.compile(r"\s*([0-9]*[.,]?[0-9]+)\s*([^\d\s].*)")


def standstill_limit(text: str) -> float:
    """The speed in m/s that a text such as 0.5km/h names."""
    match = _SPEED.fullmatch(text)
    unit = unit_named(match[2].strip()) if match else None
    known = unit is not None and unit.quantity == "speed"
    limit_mps = float(match[1].replace(",", ".")) * unit.si if known else 0.0
    if not 0 < limit_mps <= _LIMIT_MAX_MPS:
        raise DataError(
            f"--standstill {shown(text)}; allowed: a speed with its unit, above 0 to 5 km/h, such as 0.5km/h"
        )
    return limit_mps


def standing(drive: Drive, limit_mps: float) -> tuple[Drive, list[str]]:
    """The drive with its speed 0 in every slow stretch, and a text that counts them."""
    stretches = _slow(drive, limit_mps, _STANDING_S)
    speed_mps = drive.speed_mps.copy()
    for first, last in stretches:
        speed_mps[first : last + 1] = 0.0
    changed = speed_mps != drive.speed_mps
    lost_m = np.trapezoid(drive.speed_mps - speed_mps, drive.time_s)
    limit = f"{limit_mps * KMH_PER_MPS:.4g} km/h for {_STANDING_S:g} s or longer"
    text = (
        f"standstill where slower than {limit}: {changed.sum()} samples in {len(stretches)} stretches set to 0, "
        f"{lost_m:.4g} m of the distance{_places(drive, stretches)}"
    )
    return replace(drive, speed_mps=speed_mps), [text]


def never_at_rest(drive: Drive) -> list[str]:
    """One text with the stretches that look like a standstill and are none; none where there are none."""
    stretches, slow_s = [], 0.0
    for first, last in _slow(drive, _SUSPECT_MPS, _SUSPECT_S):
        at_rest = drive.speed_mps[first : last + 1] == 0
        steps_s = np.diff(drive.time_s[first : last + 1])
        long_s = float(steps_s.sum())
        if steps_s[at_rest[1:] & at_rest[:-1]].sum() < _SUSPECT_REST * long_s:
            stretches.append((first, last))
            slow_s += long_s
    if not stretches:
        return []
    return [
        f"NOTE: slower than {_SUSPECT_MPS * KMH_PER_MPS:g} km/h for {_SUSPECT_S:g} s or longer, without rest, in "
        f"{len(stretches)} stretches, {slow_s:.4g} s{_places(drive, stretches)}; this counts as driving, with the "
        "engine on; where the car stands, say below which speed, such as --standstill 0.5km/h"
    ]


def _slow(drive: Drive, limit_mps: float, least_s: float) -> list[tuple[int, int]]:
    """First and last row of every stretch of samples below a speed that lasts long enough."""
    slow = np.r_[False, drive.speed_mps < limit_mps, False]
    edges = np.flatnonzero(slow[1:] != slow[:-1])
    pairs = zip(edges[::2].tolist(), (edges[1::2] - 1).tolist(), strict=True)
    return [(a, b) for a, b in pairs if drive.time_s[b] - drive.time_s[a] >= least_s]


def _places(drive: Drive, stretches: list[tuple[int, int]], listed: int = 5) -> str:
    if not stretches:
        return ""
    texts = [f"{drive.lines[a]}-{drive.lines[b]}" for a, b in stretches[:listed]]
    more = f" and {len(stretches) - listed} more" if len(stretches) > listed else ""
    return f" (lines {', '.join(texts)}{more})"
