"""A measured map as a component: its file, what it covers, and the picture of that."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from hevopt.car_files.text import component_text
from hevopt.display.facts import Shown
from hevopt.errors import DataError, unknown_name
from hevopt.files.shown import shown
from hevopt.files.writing import check_outs, write_whole
from hevopt.measured.battery.component import ImportedBattery, import_battery
from hevopt.measured.battery.figure import battery_figure
from hevopt.measured.battery.samples import ROLES as BATTERY_ROLES
from hevopt.measured.gearbox.component import ImportedGearbox, import_gearbox
from hevopt.measured.gearbox.figure import gearbox_figure
from hevopt.measured.gearbox.points import ROLES as GEARBOX_ROLES
from hevopt.measured.maps.engine import import_engine
from hevopt.measured.maps.machine import import_machine
from hevopt.measured.maps.plot import map_figure
from hevopt.measured.maps.report import coverage
from hevopt.measured.maps.request import ImportedMap, Request
from hevopt.measured.maps.roles import ROLES
from hevopt.measured.maps.tables import Source
from hevopt.measured.maps.turbo import KINDS as TURBO_KINDS
from hevopt.measured.maps.turbo import ImportedTurbo, import_turbo
from hevopt.measured.maps.turbo_figure import turbo_figure
from hevopt.measured.maps.turbo_points import ROLES as TURBO_ROLES
from hevopt.measured.sources import digests, own_file

_IMPORTS = {"engine": import_engine, "machine": import_machine}
Imported = ImportedMap | ImportedTurbo | ImportedBattery | ImportedGearbox
_CURVES = ("--full-load", "--motoring", "--nox", "--rows")
# kind -> options that it alone, or with others, has; what its columns may be
_OPTIONS_OF = {
    "engine": _CURVES,
    "machine": _CURVES,
    "battery": ("--start-soc", "--temperature"),
    "gearbox": ("--side",),
    **dict.fromkeys(TURBO_KINDS, ("--reference",)),
}
_ROLES_OF = {
    "battery": BATTERY_ROLES,
    "gearbox": GEARBOX_ROLES,
    **dict.fromkeys(TURBO_KINDS, TURBO_ROLES),
}
# First line of every component that an import writes, by which the next import knows it.
_HEAD = "Measured map, written by hevopt maps import."


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class MapComponent(Shown):
    """A component made from measured points.

    imported: its keys and values, where each comes from, what was assumed, and the map itself
    coverage: lines of text, what the map covers and how good it is; text: of its file, TOML
    sources: the files that were read
    """

    imported: Imported
    coverage: tuple[str, ...]
    text: str
    sources: tuple[Path, ...]

    def write(self, out: str | Path) -> Path:
        """Write the component's file, and beside it the picture of what the map covers; the picture's file.

        Raises DataError where either cannot be written, is a file that was read, or replaces one that no import of
        a map has written.
        """
        path = Path(out)
        plot = check_map_file(path, self.sources)
        picture = _picture(self.imported)
        write_whole(path, self.text.encode())
        write_whole(plot, picture)
        return plot


def _picture(imported: Imported) -> bytes:
    if isinstance(imported, ImportedTurbo):
        return turbo_figure(imported)
    if isinstance(imported, ImportedBattery):
        return battery_figure(imported.file.name, imported.curves)
    if isinstance(imported, ImportedGearbox):
        return gearbox_figure(imported.file.name, imported.points, imported.grids)
    return map_figure(imported)


def import_map(
    file: str | Path,
    kind: str,
    *,
    like: str | None = None,
    full_load: str | Path | None = None,
    motoring: str | Path | None = None,
    nox: str | Path | None = None,
    columns: Mapping[str, str] | None = None,
    units: Mapping[str, str] | None = None,
    rows: str | None = None,
    sheet: str | None = None,
    values: Mapping[str, Any] | None = None,
    reference: tuple[float, float] | None = None,
    start_soc: float | None = None,
    temperature_c: float | None = None,
    side: str | None = None,
) -> MapComponent:
    """A component from measured points of an engine, a machine, a battery, or an engine's compressor or turbine.

    file: table of the points, of engine and machine also a grid or a .mat file of axes and matrix; of a battery a
    test in time (time, current, voltage, and soc or charge) or curves over charge
    kind: "engine", "machine", "battery", "gearbox", "compressor" or "turbine"
    reference: of a compressor or turbine: temperature in K and pressure in Pa to which flow and speed are corrected
    start_soc: of a battery: its state of charge at the first row, where no column has it
    temperature_c: of a battery: which of the temperatures measured the component is of
    side: of a gearbox: "input" or "output", of which speed and torque are, where their names do not tell
    like: name or file of a component that gives the remaining keys; values: key of the component -> value
    full_load, motoring, nox: FILE or FILE#SHEET of the full-load curve, the motoring curve, and NOx where `file`
    has none
    columns, units: role (speed, torque, fuel, specific, efficiency, nox, loss, electric, full, motoring;
    of a compressor or turbine speed, flow, ratio, efficiency, vanes; of a battery time, current, voltage, soc,
    charge, temperature, open_circuit, resistance, discharge, charging; of a gearbox gear, speed, torque,
    efficiency, loss) -> name of a column, its unit
    rows: "speed" or "torque", what a grid's first column holds; sheet: of a workbook
    Raises DataError where something is missing or wrong, with its place.
    """
    _refuse_others(
        kind,
        {"--reference": reference, "--start-soc": start_soc, "--temperature": temperature_c, "--side": side,
         "--full-load": full_load, "--motoring": motoring, "--nox": nox, "--rows": rows},
    )  # fmt: skip
    _check_words(kind, rows, {"columns": columns or {}, "units": units or {}})
    path = Path(file)
    common: dict[str, Any] = {
        "like": like, "columns": columns or {}, "units": units or {}, "sheet": sheet, "values": values or {},
    }  # fmt: skip
    if kind in TURBO_KINDS:
        return _whole(import_turbo(path, kind, reference=reference, **common), path, like)
    if kind == "battery":
        tested = import_battery(path, start_soc=start_soc, temperature_c=temperature_c, **common)
        return _whole(tested, path, like)
    if kind == "gearbox":
        return _whole(import_gearbox(path, side=side, **common), path, like)
    extra = {"full": full_load, "motoring": motoring, "nox": nox}
    return _mapped(Source(path, sheet, columns or {}, units or {}, rows), kind, extra, like, values)


def _mapped(
    source: Source, kind: str, extra: Mapping[str, str | Path | None], like: str | None,
    values: Mapping[str, Any] | None,
) -> MapComponent:  # fmt: skip
    """An engine or a machine, whose curves and NOx may have tables of their own."""
    others = {
        role: _beside(str(own), role, source) for role, own in extra.items() if own is not None
    }
    imported = _IMPORTS[kind](Request(source, others, like, values or {}))
    said = tuple(coverage(imported))
    sources = (source.path, *(other.path for other in others.values()))
    head = [_HEAD, *digests(sources), *imported.notes, *said]
    text = component_text(head, imported.contents, imported.origins)
    return MapComponent(imported, said, text, (*sources, *map(Path, own_file(like))))


def _check_words(kind: str, rows: str | None, roles: Mapping[str, Mapping[str, str]]) -> None:
    """DataError for an axis or a role that there is not."""
    if rows not in (None, "speed", "torque"):
        raise DataError(f"rows = {shown(rows)}; allowed: speed, torque")
    for what, given in roles.items():
        for role in given:
            if role not in roles_of(kind):
                raise DataError(f"{what}: {unknown_name('role', role, list(roles_of(kind)))}")


def roles_of(kind: str) -> tuple[str, ...]:
    """What the columns of a map may be."""
    return _ROLES_OF.get(kind, ROLES)


def _refuse_others(kind: str, given: Mapping[str, Any]) -> None:
    """DataError for a kind that is none, and for options that belong to another. given: option -> value"""
    if kind not in _OPTIONS_OF:
        raise unknown_name("kind", kind, list(_OPTIONS_OF))
    for option, value in given.items():
        if value is not None and option not in _OPTIONS_OF[kind]:
            own = [other for other, options in _OPTIONS_OF.items() if option in options]
            raise DataError(f"{option} is for {' and '.join(own)}, not for a {kind}; leave it out")


def _whole(
    found: ImportedTurbo | ImportedBattery | ImportedGearbox, path: Path, like: str | None
) -> MapComponent:
    others = [f"Other keys from {like}."] if like is not None else []
    head = [_HEAD, *digests([path]), *others, *found.notes, *found.said]
    text = component_text(head, found.contents, found.origins)
    return MapComponent(found, found.said, text, (path, *map(Path, own_file(like))))


def _beside(text: str, role: str, main: Source) -> Source:
    """A table of its own, FILE or FILE#SHEET, for one of the curves or NOx."""
    path, mark, behind = (text, "", "") if Path(text).exists() else text.partition("#")
    own = {role: main.columns[role]} if role in main.columns else {}
    own = dict(main.columns) if Path(path) == main.path else own
    sheet = behind if mark else None
    return Source(Path(path), sheet, own, main.units, main.rows, extra=True)


def check_map_file(out: Path, inputs: tuple[Path, ...]) -> Path:
    """The file of the picture beside a component's; DataError where either may not be written."""
    plot = with_suffix(out, ".png")
    check_outs({"--out": out, "the plot": plot}, inputs)
    if out.exists():
        with out.open("rb") as file:
            if file.readline().strip() == f"# {_HEAD}".encode():
                return plot
    for path in (out, plot):
        if path.exists():
            raise DataError(
                f"{path} exists, and hevopt maps import has not written it; give another name with --out, or "
                "remove it yourself"
            )
    return plot


def with_suffix(path: Path, suffix: str) -> Path:
    """A file's name with another suffix; DataError where it is no file's name."""
    if not path.stem or path.stem == "..":
        raise DataError(f"{path}: not the name of a file")
    return path.with_suffix(suffix)
