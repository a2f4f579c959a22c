"""`hevopt maps import`: points of a test bench to component files."""

from pathlib import Path
from typing import Annotated, Literal

import typer

from hevopt.commands.components import (
    ColumnOption,
    LikeOption,
    SetOption,
    SheetOption,
    UnitOption,
    values_of,
)
from hevopt.commands.options import pairs
from hevopt.commands.terminal import write
from hevopt.errors import DataError
from hevopt.files.shown import printable

maps_app = typer.Typer(help="Measured maps and tests of components.", rich_markup_mode=None)


@maps_app.callback()
def _maps() -> None:
    """Measured maps and tests of components."""


@maps_app.command("import")
def import_map(
    file: Annotated[
        Path, typer.Argument(help="Table of the points, a grid, or a .mat file of axes and matrix.")
    ],
    kind: Annotated[
        Literal["engine", "machine", "battery", "gearbox", "compressor", "turbine"],
        typer.Option(
            "--kind",
            help="engine, machine, battery, gearbox, or an engine's compressor or turbine.",
        ),
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
    reference: Annotated[
        str | None,
        typer.Option(
            "--reference",
            metavar="KELVIN,BAR",
            help="What a compressor's or turbine's flow and speed are corrected to, such as 298.15,1.013.",
        ),
    ] = None,
    start_soc: Annotated[
        float | None,
        typer.Option(
            "--start-soc",
            help="State of charge, 0 to 1, at a battery test's first row, where no column has it.",
        ),
    ] = None,
    side: Annotated[
        Literal["input", "output"] | None,
        typer.Option(
            "--side",
            help="Side of a gearbox that speed and torque are of, where their columns' names do not tell.",
        ),
    ] = None,
    temperature: Annotated[
        float | None,
        typer.Option(
            "--temperature",
            metavar="DEGC",
            help="Which of the temperatures measured a battery's file is of; without this that nearest to 25 °C.",
        ),
    ] = None,
) -> None:
    """A component file, and what it covers, from measurements of an engine, a machine, a battery or a gearbox.

    A battery's test is a table of time, current and voltage, with state of charge or the charge that passes, of
    pulses or constant current; or a table of curves: state of charge, open-circuit voltage, resistance of either
    direction.

    A gearbox's table has gear, speed, torque, and efficiency or loss, at the input or the output.

    A compressor or turbine goes into the mean_value part of the engine that --like names, as the compact map
    nearest to its points of corrected flow and speed, pressure ratio and efficiency; a turbine may have vane
    positions.

    A MATLAB file holds vectors of speed and torque and a matrix over both. Data written as a program (.m) with
    fc_map_spd, fc_map_trq, fc_fuel_map and fc_max_trq, or mc_map_spd, mc_map_trq, mc_eff_map and mc_max_trq: run it
    in MATLAB or Octave, there save('map.mat', 'fc_map_spd', 'fc_map_trq', 'fc_fuel_map', 'fc_max_trq', '-v7'), and
    import map.mat; a machine's file is its --full-load too.
    """
    from hevopt.measured.maps.component import check_map_file, roles_of, with_suffix
    from hevopt.measured.maps.component import import_map as measured_map
    from hevopt.measured.sources import own_file

    values = values_of(given)
    if displacement_cm3 is not None:
        if "displacement_cm3" in values:
            raise DataError("--displacement-cm3 and --set displacement_cm3 are one key; give one")
        values["displacement_cm3"] = displacement_cm3
    out = with_suffix(file, ".toml") if out is None else out
    check_map_file(out, (file, *map(Path, own_file(like))))
    found = measured_map(
        file, kind, like=like, full_load=full_load, motoring=motoring, nox=nox,
        columns=pairs("--column", column, roles_of(kind)), units=pairs("--unit", unit, roles_of(kind)),
        rows=rows, sheet=sheet, values=values, reference=_reference(reference), start_soc=start_soc,
        temperature_c=temperature, side=side,
    )  # fmt: skip
    plot, imported = found.write(out), found.imported
    for note in imported.notes:
        write(f"  {printable(note)}")
    kept = {key: origin for key, origin in imported.origins.items() if origin}
    for origin in dict.fromkeys(kept.values()):
        keys = ", ".join(key for key, other in kept.items() if other == origin)
        write(f"  {printable(origin)}: {printable(keys)}")
    write("\n".join(found.coverage))
    write(f"component written to {out}, plot to {plot}")


def _reference(text: str | None) -> tuple[float, float] | None:
    """Temperature in K and pressure in Pa."""
    from hevopt.files.shown import shown

    if text is None:
        return None
    try:
        kelvin, bar = (float(part) for part in text.split(","))
    except ValueError:
        raise DataError(
            f"--reference {shown(text)}; needed: temperature in K and pressure in bar, such as 298.15,1.013"
        ) from None
    return kelvin, bar * 1e5
