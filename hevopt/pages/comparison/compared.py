"""A comparison with its page, in one call; the fronts and sensitivities that a page may have beside its rows."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Unpack

from hevopt.car.architecture import Architecture
from hevopt.driving.cycle import Cycle, load_cycle
from hevopt.errors import DataError, HevoptError
from hevopt.files.writing import check_outs, write_whole
from hevopt.pages.comparison.collect import Collector, check_steps
from hevopt.pages.comparison.page import comparison_page
from hevopt.pages.comparison.results import ParetoFront, Results, Sensitivity, packed
from hevopt.pages.comparison.room import check_planned, check_room
from hevopt.reproduction.published import is_study
from hevopt.strategies import Strategy, chosen
from hevopt.studies.by_car import Progress, Watch, unseen
from hevopt.studies.cars import Cars, cars_of
from hevopt.studies.comparison import Comparison, Strategies, compare_cars
from hevopt.studies.fronts import front_of
from hevopt.studies.given import settings_from
from hevopt.studies.nox import require_nox
from hevopt.studies.provenance import files_digests
from hevopt.studies.sensitivity import effects_on
from hevopt.studies.settings import Keywords, Settings
from hevopt.studies.solved import strategies_for

_TOO_MUCH = "`hevopt report` reads no more, nothing is saved; ask for fewer cars or strategies, or a shorter cycle"


def compare_and_report(
    page: str | Path | None,
    cycle: Cycle | str | Path = "nedc",
    architectures: Architecture | str | Path | Iterable[Architecture | str | Path] | None = None,
    strategies: Strategies | None = None,
    *,
    save: str | Path | None = None,
    fronts: bool = False,
    effects: bool = False,
    progress: Progress | None = None,
    **settings: Unpack[Keywords],
) -> Comparison:
    """`compare`, and its page as one HTML file that opens offline; what failed is told on the page too.

    page: the file to write; None for none; save: file that keeps everything the page is made from (JSON, gzip), for
    `report` and `read_saved`
    fronts, effects: add every car's front of fuel and NOx, its sensitivities; what fails of them is among the
    comparison's failures
    cycle, architectures, strategies, progress, settings: as in `compare`
    Raises DataError before anything is solved: a wrong name, file or setting, a file that cannot be written,
    a cycle too long for a page; UnknownNoxError for fronts of an engine without data on NOx.
    """
    names, others = chosen(strategies)
    told = settings_from("compare_and_report", settings, strategies=names)
    if isinstance(architectures, Architecture | str | Path):
        architectures = [architectures]
    cars = cars_of(architectures, told)
    drive = cycle if isinstance(cycle, Cycle) else load_cycle(cycle)
    outs = {
        "page": None if page is None else Path(page),
        "save": None if save is None else Path(save),
    }
    if page is None and save is None:
        raise DataError("compare_and_report: name a file for the page, or one to save to")
    sources = [strategy.place.file for strategy in others.values() if strategy.place is not None]
    check_outs(outs, files_digests(cars.cars, [drive], sources))
    _check_room(drive, cars, told, others)
    for car in cars.cars if fronts else ():
        require_nox(car, "a front of fuel and NOx")
    tell, collector = progress or unseen, Collector()
    comparison = compare_cars(
        cars.cars, drive, told, others=others, watch=Watch(tell, collector.observe)
    )
    call = _call(outs, drive, cars, names, settings)
    results = collector.results(
        comparison, call, changes=cars.said(), others=sources, published=is_study(cars.cars, drive)
    )
    results, failures = with_studies(results, Extras(cars, drive, told, fronts, effects), tell)
    write_files(results, outs["page"], outs["save"])
    return replace(comparison, left_out=cars.left_out, failures=comparison.failures | failures)


def _check_room(
    cycle: Cycle, cars: Cars, settings: Settings, others: Mapping[str, Strategy]
) -> None:
    """DataError, before anything is solved, where it will be more than a page or a saved file has room for."""
    check_steps(cycle)
    rows = sum(len(strategies_for(car, settings.strategies, others)) for car in cars.cars)
    check_planned(len(cycle.time_s) - 1, len(cars.cars), rows)


def _call(
    outs: Mapping[str, Path | None],
    cycle: Cycle,
    cars: Cars,
    names: Sequence[str] | None,
    settings: Mapping[str, Any],
) -> str:
    """The call as text, cars and strategies by their names."""
    own = {"save": outs["save"] and str(outs["save"]), **settings}
    named = [f"{name}={value!r}" for name, value in own.items() if value is not None]
    parts = [outs["page"] and str(outs["page"]), cycle.name, [car.name for car in cars.cars], names]
    return f"hevopt.compare_and_report({', '.join([*map(repr, parts), *named])})"


@dataclass(frozen=True, slots=True)
class Extras:
    """What a page has beside its rows. fronts, effects: whether every car's front and sensitivities are wanted"""

    cars: Cars
    cycle: Cycle
    settings: Settings
    fronts: bool
    effects: bool


def with_studies(
    results: Results, extras: Extras, progress: Progress
) -> tuple[Results, dict[str, HevoptError]]:
    """The results of a comparison with the fronts and sensitivities of its cars, where asked for; what failed.

    A car whose front or sensitivities cannot be had is a failure, and costs no other result.
    """
    cars, cycle = extras.cars, extras.cycle
    wanted = [car for car in cars.cars if car.name in results.cars]
    settings = replace(
        extras.settings, horizon_s=None
    )  # of dp and the rules, which have no preview
    failures: dict[str, HevoptError] = {}
    drawn, moved = [], []
    for car in wanted if extras.fronts else ():
        try:
            front = front_of(car, cycle, settings, progress=progress)
            drawn.append(ParetoFront.model_validate(front.as_dict()))
        except HevoptError as error:
            failures[f"{car.name} front"] = error
    for car in wanted if extras.effects else ():
        try:
            found = effects_on(car, cars.changes[car.name], cycle, settings, None, progress)
            moved += [Sensitivity.model_validate(effect.as_dict()) for effect in found]
        except HevoptError as error:
            failures[f"{car.name} sensitivity"] = error
    update: dict[str, Any] = {"pareto": drawn} if extras.fronts else {}
    update |= {"sensitivity": moved} if extras.effects else {}
    said = results.failures | {name: str(error) for name, error in failures.items()}
    return results.model_copy(update=update | {"failures": said}), failures


def write_files(results: Results, page: Path | None, saved: Path | None) -> list[str]:
    """Write the page and the saved results, each where asked for; a line for each."""
    contents, text = [], b""
    if saved is not None:
        text = results.text()
        check_room(f"--save {saved}", text, _TOO_MUCH)
    if page is not None:
        contents.append(("report", page, comparison_page(results).encode()))
    if saved is not None:
        contents.append(("results", saved, packed(text)))
    for _, path, whole in contents:
        write_whole(path, whole)
    return [f"{what} written to {path}" for what, path, _ in contents]
