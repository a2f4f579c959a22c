"""`hevopt cycles import`: a logged drive or another tool's cycle to a cycle file."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from hevopt.commands.listing import cycles_app
from hevopt.commands.options import pairs
from hevopt.commands.terminal import write
from hevopt.errors import DataError

if TYPE_CHECKING:
    from hevopt.measured.cycles.sampled import ImportedCycle


@cycles_app.command("import")
def import_cycle(
    file: Annotated[
        Path, typer.Argument(help="CSV, TSV, Excel, .mat, VECTO .vdri or VBOX .vbo file.")
    ],
    speed_unit: Annotated[
        str | None, typer.Option(help="Unit of speed where the file names none: km/h, m/s, mph ...")
    ] = None,
    time_unit: Annotated[
        str | None, typer.Option(help="Unit of time where the file names none: s, ms, min, h.")
    ] = None,
    column: Annotated[
        list[str] | None,
        typer.Option(
            metavar="ROLE=NAME",
            help="The column of time, date, speed, distance, stop, grade, altitude, gear or clutch_open, by name "
            "or number; nothing after = leaves it out. May be repeated.",
        ),
    ] = None,
    unit: Annotated[
        list[str] | None,
        typer.Option(
            metavar="ROLE=UNIT", help="Unit of another column, such as grade=%. May be repeated."
        ),
    ] = None,
    sheet: Annotated[str | None, typer.Option(help="Sheet of a workbook that has several.")] = None,
    acceleration: Annotated[
        float | None,
        typer.Option(
            help="m/s² with which target speeds over distance are followed, as in VECTO's cycles."
        ),
    ] = None,
    standstill: Annotated[
        str | None,
        typer.Option(
            metavar="SPEED",
            help="Slower than this for 3 s or longer, the car counts as standing, such as 0.5km/h.",
        ),
    ] = None,
    altitude_baseline: Annotated[
        float | None,
        typer.Option(
            help="Metres of road over which grade is taken from altitude; chosen by its noise without this."
        ),
    ] = None,
    gaps: Annotated[
        str | None,
        typer.Option(
            metavar="cut|split|bridge",
            help="What becomes of gaps of more than a minute without a sample: cut joins what lies before and "
            "after without their time, split makes one cycle a trip (NAME_1.csv, NAME_2.csv ...), bridge draws the "
            "speed straight across. Shorter ones are dropouts, which --repair bridges.",
        ),
    ] = None,
    repair: Annotated[
        bool, typer.Option("--repair", help="Mend faults in the data; every change is listed.")
    ] = False,
    out: Annotated[Path | None, typer.Option(help="Cycle file to write, NAME.csv.")] = None,
) -> None:
    """Read a drive in another tool's shape, check it, resample it to 1 Hz; write it with --out."""
    from hevopt.measured.cycles import cycle as cycle_import
    from hevopt.measured.cycles.sampled import check_cycle_file
    from hevopt.measured.cycles.standstill import standstill_limit

    if out is not None:
        check_cycle_file(out, file)
    units = pairs("--unit", unit)
    for role, given, option in (
        ("speed", speed_unit, "--speed-unit"),
        ("time", time_unit, "--time-unit"),
    ):
        if given is not None and role in units:
            raise DataError(
                f"the unit of {role} is given by both {option} and --unit; leave one out"
            )
        units |= {} if given is None else {role: given}
    imported = cycle_import.import_drives(
        file, columns=pairs("--column", column), units=units, sheet=sheet, repair=repair, gaps=gaps,
        acceleration_mps2=acceleration,
        standstill_mps=None if standstill is None else standstill_limit(standstill),
        altitude_baseline_m=altitude_baseline,
    )  # fmt: skip
    for cycle in imported:
        _show(cycle)
    _write(imported, out, file)


def _write(imported: tuple["ImportedCycle", ...], out: Path | None, file: Path) -> None:
    from hevopt.files.writing import check_outs

    if out is None:
        write("not written; add --out NAME.csv to write the cycle" + "s" * (len(imported) > 1))
        return
    outs = [out]
    if len(imported) > 1:
        outs = [out.with_stem(f"{out.stem}_{k}") for k in range(1, len(imported) + 1)]
        check_outs({f"--out, trip {k}": path for k, path in enumerate(outs, start=1)}, [file])
    for path, cycle in zip(outs, imported, strict=True):
        cycle.write(path)
        write(f"written to {path}; use it with --cycle {path}")


def _show(imported: "ImportedCycle") -> None:
    from hevopt.measured.cycles.sampled import summary

    for text in imported.assumptions:
        write(f"read as: {text}")
    for text in imported.rules:
        write(f"made by: {text}")
    if imported.repairs:
        heading = f"repairs: {len(imported.repairs)}, by line of {imported.source}"
        write("\n  ".join([heading, *imported.repairs]))
    for name, text in summary(imported):
        write(f"{name:18}{text}")
    for text in imported.hints:
        write(text)
