"""`hevopt maps import` and `hevopt coastdown`: measured data to component files."""

import tomllib
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from hevopt.commands.options import pairs
from hevopt.commands.terminal import write
from hevopt.errors import DataError
from hevopt.files import is_path, printable, shown

if TYPE_CHECKING:
    from hevopt.imports.map_import import Request

# First line of every component that an import writes, by which the next import knows it.
_HEAD = "Measured map, written by hevopt maps import."

maps_app = typer.Typer(help="Measured maps of engines and machines.", rich_markup_mode=None)

_ColumnOption = Annotated[
    list[str] | None,
    typer.Option("--column", help="ROLE=NAME: which column holds what; may be repeated."),
]
_UnitOption = Annotated[
    list[str] | None,
    typer.Option("--unit", help="ROLE=UNIT: the unit of a column; may be repeated."),
]
_SheetOption = Annotated[str | None, typer.Option("--sheet", help="Sheet of an Excel workbook.")]
_LikeOption = Annotated[
    str | None,
    typer.Option("--like", help="Name or file of a component that gives the remaining keys."),
]
_SetOption = Annotated[
    list[str] | None,
    typer.Option("--set", help="KEY=VALUE of the component's file; may be repeated."),
]


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
    like: _LikeOption = None,
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
    given: _SetOption = None,
    column: _ColumnOption = None,
    unit: _UnitOption = None,
    rows: Annotated[
        Literal["speed", "torque"] | None,
        typer.Option(
            "--rows", help="What a grid's first column holds, or a square matrix's first index."
        ),
    ] = None,
    sheet: _SheetOption = None,
) -> None:
    """A component file, with what the map covers, from measured points of an engine or a machine.

    A MATLAB file holds vectors of speed and torque and a matrix over both. Data written as a program (.m) with
    fc_map_spd, fc_map_trq, fc_fuel_map and fc_max_trq, or mc_map_spd, mc_map_trq, mc_eff_map and mc_max_trq: run it
    in MATLAB or Octave, there save('map.mat', 'fc_map_spd', 'fc_map_trq', 'fc_fuel_map', 'fc_max_trq', '-v7'), and
    import map.mat; a machine's file is its --full-load too.
    """
    from hevopt.imports.component_text import component_text
    from hevopt.imports.figures import map_figure
    from hevopt.imports.map_engine import import_engine
    from hevopt.imports.map_machine import import_machine
    from hevopt.imports.map_report import coverage
    from hevopt.writing import check_outs, write_whole

    values = _values(given)
    if displacement_cm3 is not None:
        if "displacement_cm3" in values:
            raise DataError("--displacement-cm3 and --set displacement_cm3 are one key; give one")
        values["displacement_cm3"] = displacement_cm3
    extra = {"full": full_load, "motoring": motoring, "nox": nox}
    request = _request(file, sheet, column, unit, rows, like, extra, values)
    sources = [file, *(source.path for source in request.extra.values())]
    out = _beside(file, ".toml") if out is None else out
    plot = _beside(out, ".png")
    check_outs({"--out": out, "the plot": plot}, [*sources, *_own_file(like)])
    _check_own(out, plot)
    imported = import_engine(request) if kind == "engine" else import_machine(request)
    said = coverage(imported)
    head = [
        _HEAD,
        *_digests(sources),
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


def coastdown(
    files: Annotated[list[Path], typer.Argument(help="Tables of time and speed.")],
    mass_kg: Annotated[
        float | None, typer.Option("--mass-kg", help="Mass of the car as tested, driver included.")
    ] = None,
    rotating_mass_kg: Annotated[
        float | None,
        typer.Option("--rotating-mass-kg", help="What wheels and shafts add to the inertia."),
    ] = None,
    wheel_inertia_kgm2: Annotated[
        float | None, typer.Option("--wheel-inertia-kgm2", help="Instead: of all wheels together.")
    ] = None,
    tyre_radius_m: Annotated[
        float | None, typer.Option("--tyre-radius-m", help="Rolling radius of the tyres.")
    ] = None,
    like: _LikeOption = None,
    given: _SetOption = None,
    out: Annotated[Path | None, typer.Option("--out", help="Car file to write.")] = None,
    plot: Annotated[
        Path | None, typer.Option("--plot", help="Picture to write: .png, .svg or .pdf.")
    ] = None,
    directions: Annotated[
        str | None, typer.Option("--directions", help="Of the runs in order, such as +,-,+,-.")
    ] = None,
    column: _ColumnOption = None,
    unit: _UnitOption = None,
    sheet: _SheetOption = None,
) -> None:
    """C0, C1, C2 of the road load from coast-downs in both directions, with confidence intervals."""
    from hevopt.imports.coastdown import fit_road_load
    from hevopt.imports.coastdown_car import car_base, car_contents, check_mass, said_of_mass
    from hevopt.imports.coastdown_report import results
    from hevopt.imports.coastdown_runs import ROLES, ROLES_WITH_UNIT, read_runs
    from hevopt.imports.component_text import component_text
    from hevopt.writing import check_outs, write_whole

    check_outs({"--out": out, "--plot": plot}, [*files, *_own_file(like)])
    kind = None if plot is None else _picture_kind(plot)
    values = _values(given) | {
        key: value
        for key, value in (
            ("wheel_inertia_kgm2", wheel_inertia_kgm2),
            ("tyre_radius_m", tyre_radius_m),
        )
        if value is not None
    }
    car = car_base(like, values, rotating_mass_kg)
    check_mass(mass_kg)
    ways = None if directions is None else _ways(directions)
    columns = pairs("--column", column, ROLES)
    units = pairs("--unit", unit, ROLES_WITH_UNIT)
    runs, notes = read_runs(files, columns, units, ways, sheet)
    fit = fit_road_load(runs, mass_kg + car.rotating_kg)
    said = results(runs, fit, mass_kg, car.rotating_kg)
    contents = None if out is None else car_contents(fit, car, mass_kg)
    said += said_of_mass(mass_kg) if contents else []
    for note in notes:
        write(f"  {printable(note)}")
    write("\n".join(said))
    if contents is not None:
        head = [
            "Car with a road load from coast-downs, written by hevopt coastdown.",
            *_digests(files),
            *notes,
            *said,
        ]
        write_whole(out, component_text(head, contents, car.origins).encode())
        write(f"car written to {out}")
    else:
        write(f"no {'car ' * (plot is not None)}file written; --out FILE writes the car")
    if plot is not None:
        from hevopt.imports.figures import coastdown_figure

        write_whole(plot, coastdown_figure(runs, fit, kind))
        write(f"plot written to {plot}")


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
    from hevopt.imports.map_import import Request
    from hevopt.imports.map_roles import ROLES
    from hevopt.imports.map_tables import Source

    columns, units = pairs("--column", column, ROLES), pairs("--unit", unit, ROLES)
    others = {}
    for role, text in extra.items():
        if text is not None:
            path, mark, of_sheet = (text, "", "") if Path(text).exists() else text.partition("#")
            own = {role: columns[role]} if role in columns else {}
            own = columns if Path(path) == file else own
            of_sheet = of_sheet if mark else None
            others[role] = Source(Path(path), of_sheet, own, units, rows, extra=True)
    return Request(Source(file, sheet, columns, units, rows), others, like, values)


def _values(texts: list[str] | None) -> dict[str, Any]:
    """KEY=VALUE as a mapping; a value that is no TOML value is text."""
    values = {}
    for text in texts or []:
        key, mark, value = text.partition("=")
        if not mark or not key.strip():
            raise DataError(f"--set {shown(text)}: KEY=VALUE is needed, such as idle_rpm=800")
        try:
            read = tomllib.loads(f"x = {value}")
            values[key.strip()] = read["x"] if len(read) == 1 else value.strip()
        except (ValueError, RecursionError):
            values[key.strip()] = value.strip()
    return values


def _ways(text: str) -> list[int]:
    known = {"+": 1, "+1": 1, "1": 1, "-": -1, "-1": -1}
    words = [word.strip() for word in text.split(",")]
    wrong = [word for word in words if word not in known]
    if wrong:
        raise DataError(
            f"--directions {shown(text)}: {shown(wrong[0])}; allowed: + and -, such as +,-,+,-"
        )
    return [known[word] for word in words]


def _picture_kind(path: Path) -> str:
    kind = path.suffix.lower().removeprefix(".")
    if kind not in ("png", "svg", "pdf"):
        raise DataError(
            f"--plot {printable(str(path))}: the name ends with no kind of picture; allowed: .png, .svg and .pdf"
        )
    return kind


def _beside(path: Path, suffix: str) -> Path:
    if not path.stem or path.stem == "..":
        raise DataError(f"{path}: not the name of a file")
    return path.with_suffix(suffix)


def _own_file(like: str | None) -> list[str]:
    """The file that --like names; none where it is a shipped component."""
    return [like] if like is not None and is_path(like, ".toml") else []


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


def _digests(sources: list[Path]) -> list[str]:
    """Name, SHA-256 and program of every input, for the head of what is written."""
    import hashlib

    from hevopt import __version__

    return [
        f"From {path.name}, SHA-256 {hashlib.sha256(path.read_bytes()).hexdigest()}, hevopt {__version__}."
        for path in sources
    ]
