"""`hevopt pareto`, `sensitivity`, `reproduction` and `turbo-lag`: many problems solved for one answer."""

from collections.abc import Iterable, Mapping
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from hevopt.commands.options import (
    ArchitectureArgument,
    CycleOption,
    JsonOption,
    takes_settings,
)
from hevopt.commands.reporting import check_ending
from hevopt.commands.terminal import Progress, show, write
from hevopt.errors import DataError

if TYPE_CHECKING:
    from hevopt.driving.cycle import Cycle
    from hevopt.studies.cars import Cars

_OPTIONS = "the command line"


@takes_settings("strategies", "horizon_s")
def pareto(
    given: dict[str, Any],
    architecture: ArchitectureArgument,
    cycle: CycleOption = "nedc",
    weights: Annotated[
        str | None,
        typer.Option(
            "--weights",
            help="kg of fuel that a kg of NOx counts, separated by commas; else chosen.",
        ),
    ] = None,
    points: Annotated[
        int | None,
        typer.Option("--points", help="Choose so many weights, or until nothing is left between."),
    ] = None,
    strategy: Annotated[
        str, typer.Option("--strategy", help="Strategy whose plans are the points.")
    ] = "dp",
    json: JsonOption = False,
    out: Annotated[
        Path | None, typer.Option("--out", help="Write points and outer front to this CSV file.")
    ] = None,
) -> None:
    """Fuel against NOx: plans over the weight on NOx, and the certified front that none can cross."""
    from hevopt.commands.forecast import say_how_long
    from hevopt.commands.studies_view import front_notes, front_table, write_front
    from hevopt.driving.cycle import load_cycle
    from hevopt.studies.cars import cars_of
    from hevopt.studies.fronts import front_of
    from hevopt.studies.given import given_of, study_of

    if "nox_weight" in given:
        raise DataError("--nox-weight: a front has many weights; give them as --weights 0,10,100")
    if weights is not None and points is not None:
        raise DataError("--weights and --points: choose one, the weights or how many to choose")
    chosen = None if weights is None else _numbers("--weights", weights)
    settings = study_of(given_of(_OPTIONS, given)).settings
    cars, trace = cars_of([architecture], settings), load_cycle(cycle)
    if out is not None:
        _check_csv(out, [*cars.cars[0].files, *filter(None, [trace.source])])
    front = partial(front_of, cars.cars[0], weights=chosen, points=points)
    say_how_long(trace, lambda piece: front(piece, settings, strategy))
    with Progress() as progress:
        found = front(trace, settings, strategy, progress=progress)
    if out is not None:
        write_front(out, found)
    if json:
        short = {"shortfall_steps": found.shortfall_steps}
        write(_json(found.as_dict() | short | _about(cars, trace)))
        return
    show(front_table(found))
    write(front_notes(found, cars.cars[0], refined=settings.refine))
    if out is not None:
        write(f"front written to {out}")


@takes_settings("horizon_s")
def sensitivity(
    given: dict[str, Any],
    architecture: ArchitectureArgument,
    cycle: CycleOption = "nedc",
    json: JsonOption = False,
) -> None:
    """How fuel and NOx move with mass, resistances, losses, auxiliaries, battery and NOx map."""
    from hevopt.commands.forecast import say_how_long
    from hevopt.commands.studies_view import SHORTFALL_NOTE, effects_notes, effects_table
    from hevopt.driving.cycle import load_cycle
    from hevopt.studies.cars import cars_of
    from hevopt.studies.given import given_of, study_of
    from hevopt.studies.sensitivity import effects_on

    settings = study_of(given_of(_OPTIONS, given)).settings
    cars, trace = cars_of([architecture], settings), load_cycle(cycle)
    car = cars.cars[0]
    effects_of = partial(effects_on, car, cars.changes[car.name])
    say_how_long(trace, lambda piece: effects_of(piece, settings, settings.strategies))
    with Progress() as progress:
        effects = effects_of(trace, settings, settings.strategies, progress)
    if json:
        found = {"cycle": trace.name, "sensitivity": [effect.as_dict() for effect in effects]}
        write(_json(found | _about(cars, trace)))
        return
    for strategy in dict.fromkeys(effect.strategy for effect in effects):
        show(effects_table([effect for effect in effects if effect.strategy == strategy], trace))
    write(effects_notes(effects))
    if settings.allow_shortfall:
        write(SHORTFALL_NOTE)


def reproduction(
    out: Annotated[Path, typer.Option("--out", help="The Markdown page to write.")],
) -> None:
    """The published study beside ours, with what each difference comes from."""
    from hevopt.files.writing import check_writable, write_whole
    from hevopt.reproduction.cases import reproduce
    from hevopt.reproduction.page import page

    check_writable(out)
    with Progress() as progress:
        found = reproduce(progress)
    write_whole(out, page(found).encode())
    write(f"written to {out}")


def turbo_lag(
    out: Annotated[
        Path, typer.Option("--out", help="The Markdown page to write; its picture lies beside it.")
    ],
) -> None:
    """The published tip-in study beside ours, and the torque hole filled by the machines of C1 to E."""
    from hevopt.files.writing import check_outs, write_whole
    from hevopt.reproduction.turbo_lag.cases import turbo_lag as driven
    from hevopt.reproduction.turbo_lag.figure import filled_figure
    from hevopt.reproduction.turbo_lag.page import page

    picture = out.with_suffix(".png")
    check_outs({"--out": out, "the picture": picture}, [])
    with Progress() as progress:
        found = driven(progress)
    write_whole(out, page(found, picture.name).encode())
    write_whole(picture, filled_figure(found))
    write(f"written to {out}, picture to {picture}")


def _numbers(option: str, text: str) -> list[float]:
    from hevopt.files.shown import shown

    try:
        return [float(part) for part in text.split(",") if part.strip()]
    except ValueError:
        raise DataError(
            f"{option} {shown(text)}; needed: numbers separated by commas, such as 0,10,100"
        ) from None


def _check_csv(out: Path, inputs: Iterable[Path]) -> None:
    from hevopt.files.writing import check_outs

    check_ending("--out", out, ".csv")
    check_outs({"--out": out}, inputs)


def _about(cars: "Cars", trace: "Cycle") -> dict[str, Any]:
    from hevopt.studies.provenance import changes_shown, digests_shown, files_digests, versions

    return {
        "inputs": digests_shown(files_digests(cars.cars, [trace])),
        "versions": versions(),
        "changes": changes_shown(cars.changes),
    }


def _json(found: Mapping[str, Any]) -> str:
    from json import dumps

    return dumps(found, indent=1, allow_nan=False)
