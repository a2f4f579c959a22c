"""A gearbox component from measured losses: a loss map for each gear in place of its efficiency."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from hevopt.car_files.gearbox import GearboxFile
from hevopt.display.facts import Shown
from hevopt.errors import DataError
from hevopt.files.shown import shown
from hevopt.files.toml import checked
from hevopt.measured.gearbox.grid import MeasuredGear, gear_grids
from hevopt.measured.gearbox.points import GearPoints, read_gear_points
from hevopt.measured.like import unmeasured
from hevopt.units import RPM_PER_RADPS

_MEASURED = ("efficiency", "loss_map")
_LIKE_KEYS = ("ratios", "final_drive_ratio", "shift_gap_s", "shift_speeds", "free_gear")
# Share of the input torque by which the points may lie from the map before it is worth a warning.
_WIDE = 0.01


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class ImportedGearbox(Shown):
    """A gearbox. contents: of its file, also checked as `file`; origins: key path -> where it comes from

    notes: what was read and assumed; points, grids: what was measured, and the map of each gear; said: about them
    """

    contents: Mapping[str, Any]
    file: GearboxFile
    origins: Mapping[str, str]
    notes: tuple[str, ...]
    points: GearPoints
    grids: tuple[MeasuredGear, ...]
    said: tuple[str, ...]


def import_gearbox(
    path: Path, *, like: str | None, columns: Mapping[str, str], units: Mapping[str, str],
    sheet: str | None, values: Mapping[str, Any], side: str | None,
) -> ImportedGearbox:  # fmt: skip
    """A gearbox's file; DataError where something is missing or wrong. values: key of the component -> value"""
    if side not in (None, "input", "output"):
        raise DataError(f"side = {shown(side)}; allowed: input, output")
    base, origins = _base(path, like, values)
    ratios = [ratio * base["final_drive_ratio"] for ratio in base["ratios"]]
    points = read_gear_points(path, sheet, columns, units, side, ratios)
    grids = gear_grids(points, len(ratios), path.name)
    contents = base | {
        "loss_map": [
            {
                "speed_rpm": [float(f"{s * RPM_PER_RADPS:.7g}") for s in grid.data.speed_radps],
                "torque_nm": grid.data.torque_nm.tolist(),
                "loss_nm": [[float(f"{x:.6g}") for x in row] for row in grid.data.loss_nm],
            }
            for grid in grids
        ]
    }
    file = checked(f"component from {path.name}", contents, GearboxFile)
    return ImportedGearbox(
        contents, file, origins, points.notes, points, grids, tuple(_said(points, grids))
    )


def _base(
    path: Path, like: str | None, values: Mapping[str, Any]
) -> tuple[dict[str, Any], dict[str, str]]:
    """Every key but the maps, and where each comes from; DataError naming all that are missing."""
    base, origins = unmeasured(
        path, GearboxFile, like=like, keys=_LIKE_KEYS, values=values, measured=_MEASURED,
        source="the measured points",
    )  # fmt: skip
    missing = [key for key in ("ratios", "final_drive_ratio", "shift_speeds") if key not in base]
    if missing:
        raise DataError(
            f"the component needs {', '.join(missing)}; give --set KEY=VALUE for each, or --like NAME (such as "
            "gearbox_manual_6) to take them from another gearbox"
        )
    # All keys but the maps checked at once, before the points lean on ratios.
    checked(f"{path.name} with --like and --set", {**base, "efficiency": 1.0}, GearboxFile)
    return base, origins


def _said(points: GearPoints, grids: tuple[MeasuredGear, ...]) -> list[str]:
    said = []
    for grid in grids:
        data = grid.data
        torque, loss = np.broadcast_to(data.torque_nm, data.loss_nm.shape), data.loss_nm
        with np.errstate(invalid="ignore", divide="ignore"):
            eta = np.where((torque > 0) & (loss > 0), 1 - loss / torque, np.nan)
        rpm = data.speed_radps * RPM_PER_RADPS
        best = np.unravel_index(np.nanargmax(eta), eta.shape)
        said.append(
            f"gear {grid.number}: {len(rpm)} speeds, {rpm[0]:.4g} to {rpm[-1]:.4g} rpm, {len(data.torque_nm)} "
            f"torques, {data.torque_nm[0]:.4g} to {data.torque_nm[-1]:.4g} Nm at the input; best efficiency "
            f"{eta[best]:.2%} at {rpm[best[0]]:.4g} rpm and {data.torque_nm[best[1]]:.4g} Nm; without torque up to "
            f"{np.nanmax(np.where(torque == 0, loss, np.nan)) if (torque == 0).any() else np.nan:.3g} Nm lost"
        )
    off = np.concatenate([grid.off_nm for grid in grids])
    own = np.concatenate([grid.points for grid in grids])
    inside = ~np.isnan(off)
    worst = int(np.nanargmax(np.abs(off)))
    rms = float(np.sqrt(np.mean(off[inside] ** 2)))
    said.append(
        f"fit: {inside.sum()} points lie {rms:.3g} Nm of loss from the maps (root mean square), at most "
        f"{abs(off[worst]):.3g} Nm (line {points.lines[own[worst]]} of the file); {np.sum(~inside)} lie beyond them"
    )
    if rms > _WIDE * np.abs(points.torque_nm).max():
        said.append(
            f"  WARNING: that is more than {100 * _WIDE:g} % of the highest torque; the points scatter, or are too "
            "few for a map linear between them"
        )
    said.append("what a car asks for beyond the maps is rejected, never extrapolated")
    return said
