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
    digests,
    own_file,
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
    from hevopt.car_files.text import component_text
    from hevopt.files.writing import check_outs, write_whole
    from hevopt.measured.coastdown.car import car_base, car_contents, mass_of_test, said_of_mass
    from hevopt.measured.coastdown.fit import fit_road_load
    from hevopt.measured.coastdown.report import results
    from hevopt.measured.coastdown.runs import ROLES, ROLES_WITH_UNIT, read_runs

    check_outs({"--out": out, "--plot": plot}, [*files, *own_file(like)])
    kind = None if plot is None else _picture_kind(plot)
    values = values_of(given) | {
        key: value
        for key, value in (
            ("wheel_inertia_kgm2", wheel_inertia_kgm2),
            ("tyre_radius_m", tyre_radius_m),
        )
        if value is not None
    }
    car = car_base(like, values, rotating_mass_kg)
    tested_kg = mass_of_test(mass_kg)
    ways = None if directions is None else _ways(directions)
    columns = pairs("--column", column, ROLES)
    units = pairs("--unit", unit, ROLES_WITH_UNIT)
    runs, notes = read_runs(files, columns, units, ways, sheet)
    fit = fit_road_load(runs, tested_kg + car.rotating_kg)
    said = results(runs, fit, tested_kg, car.rotating_kg)
    contents = None if out is None else car_contents(fit, car, tested_kg)
    said += said_of_mass(tested_kg) if contents else []
    for note in notes:
        write(f"  {printable(note)}")
    write("\n".join(said))
    if out is not None and contents is not None:
        head = [
            "Car with a road load from coast-downs, written by hevopt coastdown.",
            *digests(files),
            *notes,
            *said,
        ]
        write_whole(out, component_text(head, contents, car.origins).encode())
        write(f"car written to {out}")
    else:
        write(f"no {'car ' * (plot is not None)}file written; --out FILE writes the car")
    if plot is not None and kind is not None:
        from hevopt.measured.coastdown.plot import coastdown_figure

        write_whole(plot, coastdown_figure(runs, fit, kind))
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


def _picture_kind(path: Path) -> str:
    kind = path.suffix.lower().removeprefix(".")
    if kind not in ("png", "svg", "pdf"):
        raise DataError(
            f"--plot {printable(str(path))}: the name ends with no kind of picture; allowed: .png, .svg and .pdf"
        )
    return kind
