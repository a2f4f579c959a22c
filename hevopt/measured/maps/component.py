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
# First line of every component that an import writes, by which the next import knows it.
_HEAD = "Measured map, written by hevopt maps import."


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class MapComponent(Shown):
    """A component made from measured points.

    imported: its keys and values, where each comes from, what was assumed, and the map itself
    coverage: lines of text, what the map covers and how good it is; text: of its file, TOML
    sources: the files that were read
    """

    imported: ImportedMap | ImportedTurbo
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
        imported = self.imported
        if isinstance(imported, ImportedTurbo):
            picture = turbo_figure(imported)
        else:
            picture = map_figure(imported)
        write_whole(path, self.text.encode())
        write_whole(plot, picture)
        return plot


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
) -> MapComponent:
    """A component from measured points of an engine, a machine, or of a compressor or turbine in an engine.

    file: table of the points, of engine and machine also a grid or a .mat file of axes and matrix
    kind: "engine", "machine", "compressor" or "turbine"
    reference: of a compressor or turbine: temperature in K and pressure in Pa to which flow and speed are corrected
    like: name or file of a component that gives the remaining keys; values: key of the component -> value
    full_load, motoring, nox: FILE or FILE#SHEET of the full-load curve, the motoring curve, and NOx where `file`
    has none
    columns, units: role (speed, torque, fuel, specific, efficiency, nox, loss, electric, full, motoring;
    of a compressor or turbine speed, flow, ratio, efficiency, vanes) -> name of a column, its unit
    rows: "speed" or "torque", what a grid's first column holds; sheet: of a workbook
    Raises DataError where something is missing or wrong, with its place.
    """
    turbo = kind in TURBO_KINDS
    _refuse_others(turbo, kind, rows, reference, full_load, motoring, nox)
    if rows not in (None, "speed", "torque"):
        raise DataError(f"rows = {shown(rows)}; allowed: speed, torque")
    for what, given in (("columns", columns), ("units", units)):
        for role in given or {}:
            if role not in roles_of(kind):
                raise DataError(f"{what}: {unknown_name('role', role, list(roles_of(kind)))}")
    if turbo:
        return _turbo(Path(file), kind, like, columns, units, sheet, values, reference)
    path, extra = Path(file), {"full": full_load, "motoring": motoring, "nox": nox}
    source = Source(path, sheet, columns or {}, units or {}, rows)
    others = {
        role: _beside(str(own), role, source) for role, own in extra.items() if own is not None
    }
    imported = _IMPORTS[kind](Request(source, others, like, values or {}))
    said = tuple(coverage(imported))
    sources = (path, *(other.path for other in others.values()))
    head = [_HEAD, *digests(sources), *imported.notes, *said]
    text = component_text(head, imported.contents, imported.origins)
    return MapComponent(imported, said, text, (*sources, *map(Path, own_file(like))))


def roles_of(kind: str) -> tuple[str, ...]:
    """What the columns of a map may be."""
    return TURBO_ROLES if kind in TURBO_KINDS else ROLES


def _refuse_others(
    turbo: bool, kind: str, rows: str | None, reference: tuple[float, float] | None, *curves: str | Path | None
) -> None:  # fmt: skip
    """DataError for a kind that is none, and for what belongs to another."""
    if kind not in _IMPORTS and not turbo:
        raise unknown_name("kind", kind, [*_IMPORTS, *TURBO_KINDS])
    if reference is not None and not turbo:
        raise DataError(f"--reference is for a compressor or turbine, not for {kind}; leave it out")
    if turbo and (rows is not None or any(curve is not None for curve in curves)):
        raise DataError(
            f"--full-load, --motoring, --nox and --rows are for engines and machines, not for a {kind}; leave them "
            "out"
        )


def _turbo(
    path: Path, kind: str, like: str | None, columns: Mapping[str, str] | None,
    units: Mapping[str, str] | None, sheet: str | None, values: Mapping[str, Any] | None,
    reference: tuple[float, float] | None,
) -> MapComponent:  # fmt: skip
    found = import_turbo(
        path, kind, like=like, columns=columns or {}, units=units or {}, sheet=sheet, values=values or {},
        reference=reference,
    )  # fmt: skip
    head = [_HEAD, *digests([path]), f"Other keys from {like}.", *found.notes, *found.said]
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
