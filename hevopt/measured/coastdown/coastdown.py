"""Coast-down runs to a road load with its confidence, and to the car file that carries it."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from hevopt.car_files.text import component_text
from hevopt.display.facts import Shown
from hevopt.errors import DataError, unknown_name
from hevopt.files.shown import printable
from hevopt.files.writing import check_outs, write_whole
from hevopt.measured.coastdown.car import (
    CarBase,
    car_base,
    car_contents,
    mass_of_test,
    said_of_mass,
)
from hevopt.measured.coastdown.fit import RoadLoad, Run, fit_road_load
from hevopt.measured.coastdown.plot import coastdown_figure
from hevopt.measured.coastdown.report import results
from hevopt.measured.coastdown.runs import ROLES, ROLES_WITH_UNIT, read_runs
from hevopt.measured.sources import digests, own_file

_HEAD = "Car with a road load from coast-downs, written by hevopt coastdown."
_PICTURES = ("png", "svg", "pdf")


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class CoastDown(Shown):
    """A road load measured by coast-downs.

    runs: as they were read; fit: C0, C1, C2 with their intervals; base: what else is known of the car
    mass_kg: of the car as tested; notes: how the tables were read; results: lines of text, figures and doubts
    files: the tables; like: file of a car that gave keys, if any
    """

    runs: list[Run]
    fit: RoadLoad
    base: CarBase
    mass_kg: float
    notes: tuple[str, ...]
    results: tuple[str, ...]
    files: tuple[Path, ...]
    like: tuple[Path, ...]

    def _facts(self) -> Mapping[str, Any]:
        names = ("c0_n", "c1_nspm", "c2_ns2pm2")
        return {"runs": len(self.runs), **dict(zip(names, self.fit.coefficients, strict=True))}

    def car_text(self) -> str:
        """The car file, TOML; DataError where its keys are not all known, or no car can have such a road load."""
        contents = car_contents(self.fit, self.base, self.mass_kg)
        said = [*self.notes, *self.results, *said_of_mass(self.mass_kg)]
        head = [_HEAD, *digests(self.files), *said]
        return component_text(head, contents, self.base.origins)

    def write(self, out: str | Path) -> None:
        """Write the car file; DataError as for `car_text`, and where the file cannot be written."""
        check_outs({"the car file": Path(out)}, [*self.files, *self.like])
        write_whole(Path(out), self.car_text().encode())

    def write_plot(self, out: str | Path) -> None:
        """Write a picture of runs, fit and resistance; DataError for another suffix than .png, .svg or .pdf."""
        kind = picture_kind(Path(out))
        check_outs({"the picture": Path(out)}, [*self.files, *self.like])
        write_whole(Path(out), coastdown_figure(self.runs, self.fit, kind))


def coastdown(
    files: str | Path | Iterable[str | Path],
    *,
    mass_kg: float | None,
    rotating_mass_kg: float | None = None,
    wheel_inertia_kgm2: float | None = None,
    tyre_radius_m: float | None = None,
    like: str | None = None,
    values: Mapping[str, Any] | None = None,
    directions: Sequence[int] | None = None,
    columns: Mapping[str, str] | None = None,
    units: Mapping[str, str] | None = None,
    sheet: str | None = None,
) -> CoastDown:
    """C0, C1, C2 of the road load from coast-downs in both directions, with confidence intervals.

    files: tables of time and speed; mass_kg: of the car as tested, driver included
    rotating_mass_kg: what wheels and shafts add to the inertia; or wheel_inertia_kgm2 of all wheels together with
    tyre_radius_m; or those of the car `like`, the name or file of a car that also gives the remaining keys of the
    car file; values: key of the car file -> value
    directions: +1 or -1 of the runs in order, where no column tells
    columns, units: role (time, speed, run, direction) -> the name of a column, its unit; sheet: of a workbook
    Raises DataError where something is missing or wrong, with its place; SolverError where no fit is found.
    """
    paths = tuple(map(Path, [files] if isinstance(files, str | Path) else files))
    own = {"wheel_inertia_kgm2": wheel_inertia_kgm2, "tyre_radius_m": tyre_radius_m}
    given = {**(values or {}), **{key: value for key, value in own.items() if value is not None}}
    for what, known, asked in (("columns", ROLES, columns), ("units", ROLES_WITH_UNIT, units)):
        for role in asked or {}:
            if role not in known:
                raise DataError(f"{what}: {unknown_name('role', role, list(known))}")
    base = car_base(like, given, rotating_mass_kg)
    tested_kg = mass_of_test(mass_kg)
    runs, notes = read_runs(paths, columns or {}, units or {}, directions, sheet)
    fit = fit_road_load(runs, tested_kg + base.rotating_kg)
    said = tuple(results(runs, fit, tested_kg, base.rotating_kg))
    of_like = tuple(map(Path, own_file(like)))
    return CoastDown(runs, fit, base, tested_kg, tuple(notes), said, paths, of_like)


def picture_kind(path: Path) -> str:
    """The kind of picture that a file's suffix names; DataError for another."""
    kind = path.suffix.lower().removeprefix(".")
    if kind not in _PICTURES:
        raise DataError(
            f"--plot {printable(str(path))}: the name ends with no kind of picture; allowed: .png, .svg and .pdf"
        )
    return kind
