"""`hevopt coastdown`: coast-down runs to a road load and a car file."""

from pathlib import Path
from typing import Annotated

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
from hevopt.files.shown import printable, shown


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
    like: LikeOption = None,
    given: SetOption = None,
    out: Annotated[Path | None, typer.Option("--out", help="Car file to write.")] = None,
    plot: Annotated[
        Path | None, typer.Option("--plot", help="Picture to write: .png, .svg or .pdf.")
    ] = None,
    directions: Annotated[
        str | None, typer.Option("--directions", help="Of the runs in order, such as +,-,+,-.")
    ] = None,
    column: ColumnOption = None,
    unit: UnitOption = None,
    sheet: SheetOption = None,
) -> None:
    """C0, C1, C2 of the road load from coast-downs in both directions, with confidence intervals."""
    from hevopt.files.writing import check_outs
    from hevopt.measured.coastdown.car import said_of_mass
    from hevopt.measured.coastdown.coastdown import coastdown as measure
    from hevopt.measured.coastdown.coastdown import picture_kind
    from hevopt.measured.coastdown.runs import ROLES, ROLES_WITH_UNIT
    from hevopt.measured.sources import own_file

    check_outs({"--out": out, "--plot": plot}, [*files, *own_file(like)])
    if plot is not None:
        picture_kind(plot)
    found = measure(
        files, mass_kg=mass_kg, rotating_mass_kg=rotating_mass_kg, wheel_inertia_kgm2=wheel_inertia_kgm2,
        tyre_radius_m=tyre_radius_m, like=like, values=values_of(given),
        directions=None if directions is None else _ways(directions),
        columns=pairs("--column", column, ROLES), units=pairs("--unit", unit, ROLES_WITH_UNIT), sheet=sheet,
    )  # fmt: skip
    text = None if out is None else found.car_text()
    for note in found.notes:
        write(f"  {printable(note)}")
    said = [] if text is None else said_of_mass(found.mass_kg)
    write("\n".join([*found.results, *said]))
    if out is not None:
        found.write(out)
        write(f"car written to {out}")
    else:
        write(f"no {'car ' * (plot is not None)}file written; --out FILE writes the car")
    if plot is not None:
        found.write_plot(plot)
        write(f"plot written to {plot}")


def _ways(text: str) -> list[int]:
    known = {"+": 1, "+1": 1, "1": 1, "-": -1, "-1": -1}
    words = [word.strip() for word in text.split(",")]
    wrong = [word for word in words if word not in known]
    if wrong:
        raise DataError(
            f"--directions {shown(text)}: {shown(wrong[0])}; allowed: + and -, such as +,-,+,-"
        )
    return [known[word] for word in words]
