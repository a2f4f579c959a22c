"""The designs of a study: every combination of its values, or a sample, less what constraints exclude."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import combinations_with_replacement, product
from math import ceil, floor, log2, prod
from pathlib import Path
from typing import Any, overload

import numpy as np
from numpy.typing import NDArray

from hevopt.car.architecture import Architecture
from hevopt.car_files.load import load_architecture
from hevopt.display.facts import Shown
from hevopt.errors import DataError
from hevopt.files.shown import printable, shown
from hevopt.sweeps.plan.constraints import Expression
from hevopt.sweeps.plan.jobs import NOX_WEIGHT
from hevopt.sweeps.plan.parameters import DESIGNS_MAX, Range, Scalar, Values
from hevopt.sweeps.plan.study_file import SampleFile, SweepStudy, located_changes


@dataclass(frozen=True, slots=True)
class Design:
    """A value for every parameter as the study has it, and the study's folder.

    number: its place among the designs of the study, from 0
    derived: key path -> what follows from the values
    """

    number: int
    values: Mapping[str, Scalar]
    folder: Path
    derived: Mapping[str, Expression] = field(default_factory=dict)

    @property
    def changes(self) -> dict[str, Scalar]:
        """Key path -> value of what differs from the study's architecture, paths of components being absolute."""
        changed = {key: value for key, value in self.values.items() if key != NOX_WEIGHT}
        changed |= {key: rule.value(self.values) for key, rule in self.derived.items()}
        return located_changes(self.folder, changed)

    @property
    def nox_weight(self) -> float:
        """kg of fuel that a kg of NOx counts."""
        return float(self.values.get(NOX_WEIGHT, 0.0))


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Designs(Sequence[Design], Shown):
    """Designs in order, each made when it is asked for: a million take some megabytes.

    folder: of the study; levels: per parameter, its values
    codes: (design, parameter) which of them the design has
    duplicates, excluded: how many designs were left out, as sampled before and by constraints
    """

    folder: Path
    keys: tuple[str, ...]
    levels: tuple[tuple[Scalar, ...], ...]
    codes: NDArray[np.int32]
    duplicates: int = 0
    excluded: int = 0
    derived: Mapping[str, Expression] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(self.codes)

    @overload
    def __getitem__(self, number: int) -> Design: ...
    @overload
    def __getitem__(self, number: slice) -> list[Design]: ...
    def __getitem__(self, number: int | slice) -> Design | list[Design]:
        if isinstance(number, slice):
            return [self[n] for n in range(*number.indices(len(self)))]
        row = self.codes[number].tolist()
        values = {k: of[c] for k, of, c in zip(self.keys, self.levels, row, strict=True)}
        return Design(range(len(self))[number], values, self.folder, self.derived)


def designs_of(study: SweepStudy) -> Designs:
    """The designs of a study; DataError where there are none or too many, or extreme ones are no cars.

    Every combination comes in the order of the file, the last parameter's values changing fastest; keys that share
    their first part, such as `battery.`, are one table in the file and so stand together.
    """
    keys, folder = tuple(study.parameters), study.source.parent
    if study.sample is None:
        levels, codes = _combinations(study)
    else:
        levels, codes = _sampled(study, study.sample)
    made = len(codes)
    if study.sample is not None:
        codes = codes[np.sort(np.unique(codes, axis=0, return_index=True)[1])]
    duplicates, distinct = made - len(codes), len(codes)
    codes = codes[_allowed(study, Designs(folder, keys, levels, codes))]
    designs = Designs(folder, keys, levels, codes, duplicates, distinct - len(codes), study.derived)
    if not len(designs):
        raise DataError(
            f"{study.source}: the constraints exclude each of {distinct} designs; loosen one, or widen "
            "the parameters' ranges"
        )
    for number in _extremes(designs):
        car_of(study, designs[number])
    return designs


def car_of(study: SweepStudy, design: Design) -> Architecture:
    """The car of a design; DataError names the design where its values do not go together."""
    try:
        return load_architecture(study.architecture, design.changes)
    except DataError as error:
        values = ", ".join(
            f"{printable(k)} = {shown(v)}" for k, v in design.values.items() if k != NOX_WEIGHT
        )
        raise DataError(
            f"{study.source}: design {design.number} ({values}) is no car: {error}; exclude it by a "
            "constraint, or change the parameters' values"
        ) from None


def cars_of(study: SweepStudy, designs: Designs) -> Iterator[Architecture]:
    """Cars of some designs that are made of all the files that any is: only texts name components."""
    texts = [n for n, of in enumerate(designs.levels) if isinstance(of[0], str)]
    found = np.unique(designs.codes[:, texts], axis=0, return_index=True)[1] if texts else [0]
    for number in found:
        yield car_of(study, designs[int(number)])


def merged_values(study: SweepStudy) -> dict[str, tuple[int, int]]:
    """Key -> how many values a range asks for, and how many distinct ones there are where that is fewer."""
    asked = {
        key: v.count for key, v in study.parameters.items() if isinstance(v, Range) and v.count
    }
    distinct = {key: len(_levels(study.parameters[key])) for key in asked}
    return {key: (count, distinct[key]) for key, count in asked.items() if distinct[key] < count}


def groups_of(
    designs: Iterable[Design],
) -> list[tuple[dict[str, Scalar], list[tuple[int, float]]]]:
    """Changes of a car, and the number and NOx weight of every design that has them, in order of appearance."""
    groups: dict[tuple[Any, ...], tuple[dict[str, Scalar], list[tuple[int, float]]]] = {}
    for design in designs:
        changes = design.changes
        members = groups.setdefault(tuple(changes.values()), (changes, []))[1]
        members.append((design.number, design.nox_weight))
    return list(groups.values())


def _levels(values: Values) -> tuple[Scalar, ...]:
    """The values of a list, or of a range with a count: after rounding, each once."""
    if not isinstance(values, Range):
        return values
    number = values.count or 1
    return tuple(dict.fromkeys(values.at(n, number - 1) for n in range(number)))


def _combinations(study: SweepStudy) -> tuple[tuple[tuple[Scalar, ...], ...], NDArray[np.int32]]:
    levels = tuple(_levels(values) for values in study.parameters.values())
    sizes = [len(values) for values in levels]
    total = prod(sizes)
    if total > DESIGNS_MAX:
        raise DataError(
            f"{study.source}: {' x '.join(map(str, sizes))} values make {total:.3g} designs; allowed: up "
            f"to {DESIGNS_MAX}; give fewer values, or the table [sample]"
        )
    codes = np.empty((total, len(sizes)), dtype=np.int32)
    for n, size in enumerate(sizes):
        codes[:, n] = np.arange(total) // prod(sizes[n + 1 :]) % size
    return levels, codes


def _sampled(
    study: SweepStudy, sample: SampleFile
) -> tuple[tuple[tuple[Scalar, ...], ...], NDArray[np.int32]]:
    shares = _unit_sample(sample, len(study.parameters))
    columns = [
        _column(values, shares[:, n].tolist()) for n, values in enumerate(study.parameters.values())
    ]
    codes = np.column_stack([codes for _, codes in columns]).astype(np.int32)
    return tuple(levels for levels, _ in columns), codes


def _unit_sample(sample: SampleFile, dimensions: int) -> NDArray[np.float64]:
    """(design, parameter) in [0, 1). Of a Sobol sequence, the first ones of the next power of two."""
    from scipy.stats import qmc

    if sample.method == "latin_hypercube":
        shares: NDArray[np.float64] = qmc.LatinHypercube(dimensions, seed=sample.seed).random(
            sample.count
        )
        return shares
    powers = ceil(log2(sample.count))
    points: NDArray[np.float64] = qmc.Sobol(dimensions, seed=sample.seed).random_base2(powers)
    return points[: sample.count]


def _column(
    values: Values, shares: Sequence[float]
) -> tuple[tuple[Scalar, ...], NDArray[np.int64]]:
    """Values of one parameter, and which of them each design has.

    Listed or counted values have an equal share each, so has each whole number of a linear range.
    """
    if not isinstance(values, Range) or values.count is not None:
        levels = _levels(values)
        count = len(levels)
        return levels, np.array([min(floor(s * count), count - 1) for s in shares])
    if values.whole and not values.log:
        whole = values.high - values.low + 1
        found = [min(values.low + floor(share * whole), values.high) for share in shares]
    else:
        found = [values.at(share, 1.0) for share in shares]
    distinct, codes = np.unique(np.array(found), return_inverse=True)
    return tuple(distinct.tolist()), codes


def _allowed(study: SweepStudy, designs: Designs) -> NDArray[np.bool_]:
    """(design,) whether it meets every constraint."""
    if not study.constraints:
        return np.ones(len(designs), dtype=bool)
    try:
        return np.fromiter(
            (all(c.holds(d.values) for c in study.constraints) for d in designs), bool, len(designs)
        )
    except DataError as error:
        raise DataError(f"{study.source}, constraints: {error}") from None


def _extremes(designs: Designs) -> Iterator[int]:
    """Numbers of the designs nearest to both ends of every parameter of the car, and of every two of them."""
    places = {
        key: _places(levels)[designs.codes[:, n]]
        for n, (key, levels) in enumerate(zip(designs.keys, designs.levels, strict=True))
        if key != NOX_WEIGHT and len(levels) > 1
    }
    found: dict[int, None] = {}
    for one, other in combinations_with_replacement(places.values(), 2):
        for toward, away in product((1, -1), repeat=2):
            found[int(np.argmax(toward * one + away * other))] = None
    yield from found


def _places(levels: Sequence[Scalar]) -> NDArray[np.float64]:
    """Where values stand between their ends, 0 to 1; texts by their order in the list."""
    numbers = levels if isinstance(levels[0], int | float) else range(len(levels))
    values = np.array(numbers, dtype=float)
    places: NDArray[np.float64] = (values - values.min()) / (values.max() - values.min())
    return places
