"""`hevopt maps import`: points of a test bench to component files."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from hevopt.commands.components import (
    ColumnOption,
    LikeOption,
    SetOption,
    SheetOption,
    UnitOption,
    digests,
    own_file,
    values_of,
)
from hevopt.commands.options import pairs
from hevopt.commands.terminal import write
from hevopt.errors import DataError
from hevopt.files.shown import printable

if TYPE_CHECKING:
    from hevopt.measured.maps.request import Request

# First line of every component that an import writes, by which the next import knows it.
_HEAD = "Measured map, written by hevopt maps import."

maps_app = typer.Typer(help="Measured maps of engines and machines.", rich_markup_mode=None)


@maps_app.callback()
def _maps() -> None:
    """Measured maps of engines and machines."""


@maps_app.command("import")
def import_map(
    file: Annotated[
        Path, typer.Argument(help="Table of the points, a grid, or a .mat file of axes and matrix.")
    ],
    kind: Annotated[
        Literal["engine", "machine"], typer.Option("--kind", help="engine or machine.")
    ],
    like: LikeOption = None,
    out: Annotated[
        Path | None,
        typer.Option("--out", help="Component file to write (default: FILE's name with .toml)."),
    ] = None,
    full_load: Annotated[
        str | None, typer.Option("--full-load", help="FILE or FILE#SHEET of the full-load curve.")
    ] = None,
    motoring: Annotated[
        str | None, typer.Option("--motoring", help="FILE or FILE#SHEET of the motoring curve.")
    ] = None,
    nox: Annotated[
        str | None, typer.Option("--nox", help="FILE or FILE#SHEET of NOx, where not in FILE.")
    ] = None,
    displacement_cm3: Annotated[
        float | None, typer.Option("--displacement-cm3", help="Displacement of the engine.")
    ] = None,
    given: SetOption = None,
    column: ColumnOption = None,
    unit: UnitOption = None,
    rows: Annotated[
        Literal["speed", "torque"] | None,
        typer.Option(
            "--rows", help="What a grid's first column holds, or a square matrix's first index."
        ),
    ] = None,
    sheet: SheetOption = None,
) -> None:
    """A component file, with what the map covers, from measured points of an engine or a machine.

    A MATLAB file holds vectors of speed and torque and a matrix over both. Data written as a program (.m) with
    fc_map_spd, fc_map_trq, fc_fuel_map and fc_max_trq, or mc_map_spd, mc_map_trq, mc_eff_map and mc_max_trq: run it
    in MATLAB or Octave, there save('map.mat', 'fc_map_spd', 'fc_map_trq', 'fc_fuel_map', 'fc_max_trq', '-v7'), and
    import map.mat; a machine's file is its --full-load too.
    """
    from hevopt.car_files.text import component_text
    from hevopt.files.writing import check_outs, write_whole
    from hevopt.measured.maps.engine import import_engine
    from hevopt.measured.maps.machine import import_machine
    from hevopt.measured.maps.plot import map_figure
    from hevopt.measured.maps.report import coverage

    values = values_of(given)
    if displacement_cm3 is not None:
        if "displacement_cm3" in values:
            raise DataError("--displacement-cm3 and --set displacement_cm3 are one key; give one")
        values["displacement_cm3"] = displacement_cm3
    extra = {"full": full_load, "motoring": motoring, "nox": nox}
    request = _request(file, sheet, column, unit, rows, like, extra, values)
    sources = [file, *(source.path for source in request.extra.values())]
    out = _beside(file, ".toml") if out is None else out
    plot = _beside(out, ".png")
    check_outs({"--out": out, "the plot": plot}, [*sources, *own_file(like)])
    _check_own(out, plot)
    imported = import_engine(request) if kind == "engine" else import_machine(request)
    said = coverage(imported)
    head = [
        _HEAD,
        *digests(sources),
        *imported.notes,
        *said,
    ]
    text = component_text(head, imported.contents, imported.origins)
    picture = map_figure(imported)
    write_whole(out, text.encode())
    write_whole(plot, picture)
    for note in imported.notes:
        write(f"  {printable(note)}")
    kept = {key: origin for key, origin in imported.origins.items() if origin}
    for origin in dict.fromkeys(kept.values()):
        keys = ", ".join(key for key, other in kept.items() if other == origin)
        write(f"  {printable(origin)}: {printable(keys)}")
    write("\n".join(said))
    write(f"component written to {out}, plot to {plot}")


def _request(
    file: Path,
    sheet: str | None,
    column: list[str] | None,
    unit: list[str] | None,
    rows: str | None,
    like: str | None,
    extra: dict[str, str | None],
    values: dict[str, Any],
) -> "Request":
    from hevopt.measured.maps.request import Request
    from hevopt.measured.maps.roles import ROLES
    from hevopt.measured.maps.tables import Source

    columns, units = pairs("--column", column, ROLES), pairs("--unit", unit, ROLES)
    others = {}
    for role, text in extra.items():
        if text is not None:
            path, mark, behind = (text, "", "") if Path(text).exists() else text.partition("#")
            own = {role: columns[role]} if role in columns else {}
            own = columns if Path(path) == file else own
            of_sheet = behind if mark else None
            others[role] = Source(Path(path), of_sheet, own, units, rows, extra=True)
    return Request(Source(file, sheet, columns, units, rows), others, like, values)


def _beside(path: Path, suffix: str) -> Path:
    if not path.stem or path.stem == "..":
        raise DataError(f"{path}: not the name of a file")
    return path.with_suffix(suffix)


def _check_own(out: Path, plot: Path) -> None:
    """DataError where the component or its plot would replace a file that no map import has written."""
    if out.exists():
        with out.open("rb") as file:
            if file.readline().strip() == f"# {_HEAD}".encode():
                return
    for path in (out, plot):
        if path.exists():
            raise DataError(
                f"{path} exists, and hevopt maps import has not written it; give another name with --out, or "
                "remove it yourself"
            )
