"""A measured map of an engine or a machine as a component: its file, what it covers, and the picture of that."""

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

    imported: ImportedMap
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
        picture = map_figure(self.imported)
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
) -> MapComponent:
    """A component from measured points of an engine or a machine.

    file: table of the points, a grid, or a .mat file of axes and matrix; kind: "engine" or "machine"
    like: name or file of a component that gives the remaining keys; values: key of the component -> value
    full_load, motoring, nox: FILE or FILE#SHEET of the full-load curve, the motoring curve, and NOx where `file`
    has none
    columns, units: role (speed, torque, fuel, specific, efficiency, nox, loss, electric, full, motoring) -> name of
    a column, its unit
    rows: "speed" or "torque", what a grid's first column holds; sheet: of a workbook
    Raises DataError where something is missing or wrong, with its place.
    """
    if kind not in _IMPORTS:
        raise unknown_name("kind", kind, list(_IMPORTS))
    if rows not in (None, "speed", "torque"):
        raise DataError(f"rows = {shown(rows)}; allowed: speed, torque")
    for what, given in (("columns", columns), ("units", units)):
        for role in given or {}:
            if role not in ROLES:
                raise DataError(f"{what}: {unknown_name('role', role, list(ROLES))}")
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
