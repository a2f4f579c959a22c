"""The index page of a folder of saved comparisons, made from the files alone."""

from itertools import groupby, pairwise
from pathlib import Path

from hevopt.errors import DataError
from hevopt.files.shown import printable
from hevopt.pages.comparison.saved import load_results
from hevopt.pages.folder.differences import (
    SavedComparison,
    cell,
    differences,
    moved,
    rows_apart,
    saved_comparison,
)
from hevopt.pages.render import render
from hevopt.studies.provenance import versions

_SUFFIXES = (".json", ".json.gz")
FILES_MAX = 200


def folder_page(folder: Path) -> tuple[str, list[Path]]:
    """The page as HTML, and the files behind it; DataError where the folder holds no saved comparison."""
    files = sorted(p for p in folder.iterdir() if p.name.endswith(_SUFFIXES) and p.is_file())
    if len(files) > FILES_MAX:
        raise DataError(f"{folder}: {len(files)} saved files; allowed: up to {FILES_MAX} on a page")
    found, left = _read(files)
    if not found:
        why = f"; {left[0][0]}: {left[0][1]}" if left else ""
        raise DataError(
            f"{folder}: no saved comparison in it (files ending in {' or '.join(_SUFFIXES)}, as hevopt compare "
            f"--save writes them){why}"
        )
    page = render(
        "folder.html.j2",
        ("folder.js",),
        b"",
        figures=False,
        title=f"Comparisons in {printable(folder.resolve().name)}",
        groups=[_group(cycle, own) for cycle, own in _by_cycle(found)],
        found=found,
        left=left,
        versions=versions(),
    )
    return page, files


def _read(files: list[Path]) -> tuple[list[SavedComparison], list[tuple[str, str]]]:
    """The comparisons of files, and those left out with the reason."""
    found, left = [], []
    for file in files:
        try:
            found.append(saved_comparison(printable(file.name), load_results(file)))
        except DataError as error:
            left.append((printable(file.name), str(error).replace(f"{file}: ", "", 1)))
    return found, left


def _by_cycle(found: list[SavedComparison]) -> list[tuple[str, list[SavedComparison]]]:
    ordered = sorted(found, key=lambda saved: (saved.cycle, saved.file))
    return [(cycle, list(own)) for cycle, own in groupby(ordered, key=lambda s: s.cycle)]


def _by_car(own: list[SavedComparison]) -> list[str]:
    """The rows of all comparisons, those of a car together, cars and rows in the order that they first stand in."""
    car_of = {name: row.architecture for saved in own for name, row in saved.rows.items()}
    cars = list(dict.fromkeys(car_of.values()))
    return sorted(car_of, key=lambda name: cars.index(car_of[name]))


def _group(cycle: str, own: list[SavedComparison]) -> dict[str, object]:
    """The comparisons of a cycle side by side, and each against the one before it."""
    names = _by_car(own)
    return {
        "cycle": cycle,
        "saved": own,
        "rows": [(name, [cell(saved, name) for saved in own]) for name in names],
        "steps": [
            {
                "before": before.file,
                "after": after.file,
                "differences": differences(before, after),
                "moved": moved(before, after),
                "weights": before.nox_weight != after.nox_weight,
                "apart": rows_apart(before, after),
            }
            for before, after in pairwise(own)
        ],
    }
