"""Strategies of the user's own in a sweep: named by where they stand, so that every worker process finds them."""

import ast
import hashlib
from collections.abc import Iterable
from pathlib import Path

from hevopt.car.architecture import Architecture
from hevopt.errors import DataError, unknown_name
from hevopt.files.shown import printable
from hevopt.strategies import STRATEGIES, every_strategy, fitting
from hevopt.strategies.brought import FORMS, Located, check_name, is_reference, located
from hevopt.sweeps.plan.jobs import Brought


def brought_of(
    names: Iterable[str], folder: Path, car: Architecture | None, others: Iterable[str]
) -> tuple[dict[str, Brought], list[Path], list[str]]:
    """Of a study's strategies those from outside, the files they stand in, and what is wrong with any of them.

    folder: of the study, from where files are named; car: None where it has faults itself, so that any may fit
    others: names that are allowed too. No file of a strategy is run here.
    """
    fit = [*(fitting(car.marks, every=True) if car else every_strategy()), *others]
    found: dict[str, Brought] = {}
    files, faults = [], []
    for name in names:
        if name in fit and (name in STRATEGIES or name in others):
            continue
        try:
            place, learns = _place(name, folder, fit, car)
            found[name] = Brought(place.reference, source_digest(place.file), learns)
            files.append(place.file)
        except DataError as error:
            faults.append(f"strategies: {error}")
    return found, files, faults


def source_digest(file: Path) -> str:
    """SHA-256 of the file that a strategy stands in."""
    try:
        return hashlib.sha256(file.read_bytes()).hexdigest()
    except OSError as error:
        raise DataError(f"{file}: cannot be read ({error.strerror})") from None


def _place(
    name: str, folder: Path, fit: list[str], car: Architecture | None
) -> tuple[Located, bool]:
    """Where a strategy stands, and whether it learns; DataError where no worker could import it."""
    known = every_strategy()
    if name in known and name not in fit and car is not None:
        raise DataError(f"{name} does not fit {car.name}; allowed: {', '.join(fit)}")
    if name in known:
        place = known[name].place
        if place is None:
            raise DataError(
                f"{printable(name)} was registered as a function that worker processes cannot import (a lambda, "
                f"one inside another, or one of a notebook or script); put it into a file and register {FORMS}"
            )
        return place, known[name].learns
    if not is_reference(name):
        error = unknown_name("strategy", printable(name), fit)
        raise DataError(f"{error}, or {FORMS}")
    place = located(check_name(name, STRATEGIES), folder)
    check_defined(place)
    return place, False


def check_defined(place: Located) -> None:
    """DataError where a file has no such name at its top, told by its text alone."""
    if place.module:
        return
    try:
        tree = ast.parse(place.file.read_bytes(), place.file.name)
    except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
        raise DataError(f"{place.file}: no Python that can be read ({error})") from None
    names = {
        name
        for node in tree.body
        for name in (
            [node.name]
            if isinstance(node, ast.FunctionDef | ast.ClassDef)
            else [part.id for part in ast.walk(node) if isinstance(part, ast.Name)]
            + [a.asname or a.name for a in getattr(node, "names", []) if isinstance(a, ast.alias)]
        )
    }
    first = place.function.split(".")[0]
    if first not in names:
        raise unknown_name(f"{place.file}: function", first, sorted(names))
