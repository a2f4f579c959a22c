"""What laboratories measured on the real cars: tables beside their files, put together per car and cycle."""

import csv
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from statistics import fmean
from typing import Any, NamedTuple

from hevopt.display.facts import Shown
from hevopt.errors import DataError, unknown_name
from hevopt.files.lookup import read_text, shipped_folder

# The FTP: a cold UDDS counts 0.43, a warm one 0.57; bag 1, cold, and bag 3, warm, are one trace of 3.59 miles, the
# first of a UDDS of 7.50 miles (40 CFR 86.144, 600.113).
COLD_WEIGHT = 0.43
_BAG_SHARE = 3.59 / 7.50
_MEGABYTES_MAX = 1


class LabTest(NamedTuple):
    """One test; start: "cold" (FTP), "warm", or "unknown" where a label tells the fuel only; fuel in l/100 km."""

    car: str
    cycle: str
    start: str
    fuel_l_per_100km: float
    bag1_l_per_100km: float | None
    bag3_l_per_100km: float | None
    test: str
    status: str
    source: str

    @property
    def cold_l_per_100km(self) -> float | None:
        """What the cold start adds to the test, by its bags; None where it is in the figure and not known."""
        if self.bag1_l_per_100km is not None and self.bag3_l_per_100km is not None:
            return COLD_WEIGHT * _BAG_SHARE * (self.bag1_l_per_100km - self.bag3_l_per_100km)
        return 0.0 if self.start == "warm" else None


class About(NamedTuple):
    """The electric load of another published model of a car, and what its data lack."""

    other_load_w: float
    source: str
    faults: str


class Changed(NamedTuple):
    """What of a car's file was changed after the first results were seen: keys with the values before, and why."""

    values: dict[str, Any]
    said: tuple[str, ...]


@dataclass(frozen=True, slots=True, repr=False)
class Laboratory(Shown):
    """All tests of one car on one cycle; figures are their means, l/100 km."""

    car: str
    cycle: str
    tests: Sequence[LabTest]

    def _facts(self) -> dict[str, object]:
        return {"car": self.car, "cycle": self.cycle, "tests": len(self.tests)}

    @property
    def fuel_l_per_100km(self) -> float:
        """As measured, cold starts and all."""
        return fmean(test.fuel_l_per_100km for test in self.tests)

    @property
    def cold_l_per_100km(self) -> float | None:
        """What cold starts add to it; None where that is not known."""
        found = [test.cold_l_per_100km for test in self.tests]
        known = [cold for cold in found if cold is not None]
        return fmean(known) if len(known) == len(found) else None

    @property
    def warm_l_per_100km(self) -> float | None:
        """Fuel of the warm car; None where the cold start's share is not known."""
        cold = self.cold_l_per_100km
        return None if cold is None else self.fuel_l_per_100km - cold

    @property
    def spread_percent(self) -> float:
        """Highest less lowest test, of the mean, cold starts taken off where they are known."""
        found = [test.fuel_l_per_100km - (test.cold_l_per_100km or 0.0) for test in self.tests]
        return 100 * (max(found) - min(found)) / fmean(found)


@cache
def every_test() -> tuple[LabTest, ...]:
    """Every test beside the real cars' files."""
    return tuple(
        LabTest(
            row["car"],
            row["cycle"],
            row["start"],
            float(row["fuel_l_per_100km"]),
            _number(row["bag1_l_per_100km"]),
            _number(row["bag3_l_per_100km"]),
            row["test"],
            row["status"],
            row["source"],
        )
        for row in _rows("measured.csv")
    )


@cache
def about() -> dict[str, About]:
    """Car -> what else is said of it."""
    return {
        row["car"]: About(float(row["other_load_w"]), row["source"], row["faults"])
        for row in _rows("about.csv")
    }


@cache
def changed() -> dict[str, Changed]:
    """Car -> what of its file was changed after the first results were seen; values as in TOML."""
    rows, found = _rows("changed.csv"), {}
    for car in dict.fromkeys(row["car"] for row in rows):
        own = [row for row in rows if row["car"] == car]
        values = {row["key"]: tomllib.loads(f"value = {row['value']}")["value"] for row in own}
        found[car] = Changed(values, tuple(row["change"] for row in own if row["change"]))
    return found


def laboratories(
    cars: Sequence[str] | None = None, cycles: Sequence[str] | None = None
) -> list[Laboratory]:
    """What was measured, per car and cycle in the order of the file; of some cars and cycles only, where given.

    Raises DataError for a car or a cycle without a test.
    """
    grouped: dict[tuple[str, str], list[LabTest]] = {}
    for test in every_test():
        grouped.setdefault((test.car, test.cycle), []).append(test)
    for wanted, known, word in (
        (cars, [car for car, _ in grouped], "car with a test"),
        (cycles, [cycle for _, cycle in grouped], "cycle with a test"),
    ):
        if wanted is not None and not wanted:
            raise DataError(
                f"no {word.split()[0]} is named; name at least one, or leave it out for all"
            )
        for name in wanted or ():
            if name not in known:
                raise unknown_name(word, name, list(dict.fromkeys(known)))
    found = [
        Laboratory(car, cycle, measured)
        for (car, cycle), measured in grouped.items()
        if (cars is None or car in cars) and (cycles is None or cycle in cycles)
    ]
    if not found:
        raise DataError(
            f"no test of {', '.join(cars or ())} on {', '.join(cycles or ())}; name other cars or cycles"
        )
    return found


def measured_files() -> list[Path]:
    """The files that the tests come from."""
    return [_folder() / name for name in ("measured.csv", "about.csv", "changed.csv")]


def _folder() -> Path:
    return shipped_folder("architectures") / "real"


def _rows(name: str) -> list[dict[str, str]]:
    text = read_text(_folder() / name, _MEGABYTES_MAX)
    return list(csv.DictReader(line for line in text.splitlines() if not line.startswith("#")))


def _number(text: str) -> float | None:
    return float(text) if text else None
