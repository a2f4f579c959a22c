"""The parameters of a sweep: what values each takes, and whether the architecture has such keys and allows them."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, Self

from pydantic import AfterValidator, Field, create_model, model_validator

from hevopt.errors import DataError
from hevopt.files.shown import printable, shown
from hevopt.files.toml import FileModel, checked
from hevopt.sweeps.plan.constraints import Kind
from hevopt.sweeps.plan.jobs import NOX_WEIGHT

DESIGNS_MAX = 1_000_000
_LIST_MAX = 10_000
# Within this, whole numbers are exact as floats.
_NUMBER_MAX = 1e15
_LOG_MIN = 1e-15
_NOX_WEIGHT_MAX = 1e6
# Deeper than any key of an architecture.
_DEPTH_MAX = 8

Scalar = bool | int | float | str
Load = Callable[[Mapping[str, Any]], object]


def _kind(value: object) -> Kind | None:
    if isinstance(value, bool):
        return "truth"
    if isinstance(value, str):
        return "text"
    return "number" if isinstance(value, int | float) else None


def _number(value: Any) -> int | float:
    if not isinstance(value, int | float) or isinstance(value, bool):
        raise ValueError("a number is needed")
    if not abs(value) <= _NUMBER_MAX:
        raise ValueError(f"allowed: {-_NUMBER_MAX:g} to {_NUMBER_MAX:g}")
    return value


_Number = Annotated[Any, AfterValidator(_number)]
_ENDS: dict[str, Any] = {"from": (_Number, ...), "to": (_Number, ...)}
_Ends: Any = create_model("_Ends", __base__=FileModel, **_ENDS)


class RangeFile(_Ends):  # type: ignore[misc]
    """Numbers from one to another; whole ones where both ends are."""

    count: Annotated[int, Field(ge=2, le=DESIGNS_MAX)] | None = None
    log: bool = False

    @model_validator(mode="after")
    def _rise(self) -> Self:
        low, high = getattr(self, "from"), self.to
        if not low < high:
            raise ValueError(f"from {low:g} must be below to {high:g}")
        if self.log and low < _LOG_MIN:
            raise ValueError(f"from {low:g} must be {_LOG_MIN:g} or more where log is true")
        return self


@dataclass(frozen=True, slots=True)
class Range:
    """Numbers from `low` to `high`, both included: `count` of them, or any where count is None."""

    low: int | float
    high: int | float
    count: int | None
    log: bool

    @property
    def whole(self) -> bool:
        """Whether it holds whole numbers only."""
        return isinstance(self.low, int) and isinstance(self.high, int)

    def at(self, part: float, of: float) -> int | float:
        """The value at `part` of `of` equal parts of the way, in logarithms where it is a log range.

        It is rounded, to a whole number or else to 12 digits, so that a third of 0.3 is 0.1.
        """
        low, high = self.low, self.high
        if part in (0, of):
            return low if part == 0 else high
        if self.log:
            value = low * (high / low) ** (part / of)
        else:
            value = (low * (of - part) + high * part) / of
        rounded = round(value) if self.whole else float(f"{value:.12g}")
        return min(max(rounded, low), high)


Values = Range | tuple[Scalar, ...]


def flattened(
    tables: Mapping[str, Any], above: str = "", depth: int = 1
) -> Iterator[tuple[str, Any]]:
    """Key path and value of every list and range in nested tables, as dotted keys make them."""
    for key, value in tables.items():
        nest = isinstance(value, dict) and value and not {"from", "to"} & set(value)
        if nest and depth < _DEPTH_MAX:
            yield from flattened(value, f"{above}{key}.", depth + 1)
        else:
            yield f"{above}{key}", value


def values_of(key: str, given: Any) -> Values:
    """The values of a parameter as its file has them, NOx weights as floats; DataError with place and fault."""
    place, as_given = f"parameters.{printable(key)}", key != NOX_WEIGHT
    if isinstance(given, dict):
        file = checked(place, given, RangeFile)
        low, high = (end if as_given else float(end) for end in (getattr(file, "from"), file.to))
        return Range(low, high, file.count, file.log)
    try:
        values = _listed(given)
    except ValueError as fault:
        raise DataError(f"{place} = {shown(given)}: {fault}") from None
    if as_given or _kind(values[0]) != "number":
        return tuple(values)
    return tuple(map(float, values))


def _listed(values: Any) -> list[Scalar]:
    if not isinstance(values, list):
        raise ValueError("a list [...] or a range { from = , to = , count = } is needed")
    if not 1 <= len(values) <= _LIST_MAX:
        raise ValueError(f"{len(values)} entries; needed: 1 to {_LIST_MAX}")
    kinds = {_kind(value) for value in values}
    if len(kinds) != 1 or None in kinds:
        raise ValueError("entries must be all numbers, all texts in quotes, or all true or false")
    if kinds == {"number"}:
        values = [_number(value) for value in values]
    listed: list[Scalar] = values
    seen: set[Scalar] = set()
    for value in listed:
        if value in seen:
            raise ValueError(f"{shown(value)} is given twice; give it once")
        seen.add(value)
    return listed


def kind_of(values: Values) -> Kind:
    """What a constraint may do with a parameter's values."""
    return "number" if isinstance(values, Range) else _kind(values[0]) or "text"


def parameter_faults(load: Load, parameters: Mapping[str, Values]) -> Iterator[str]:
    """What is wrong with single values: of numbers, the ends are tried; of texts, every one.

    load: makes the car with some changes, or raises DataError
    """
    tried = {key: _telling(values) for key, values in parameters.items()}
    cars = {key: values for key, values in tried.items() if key != NOX_WEIGHT}
    for weight in tried.get(NOX_WEIGHT, ()):
        number = isinstance(weight, int | float) and not isinstance(weight, bool)
        if not (number and 0 <= float(weight) <= _NOX_WEIGHT_MAX):
            yield (
                f"parameters.{NOX_WEIGHT} = {shown(weight)}; allowed: 0 to {_NOX_WEIGHT_MAX:g} kg fuel "
                "per kg NOx"
            )
    for key, values in cars.items():
        seen: set[str | None] = {None}
        for value in values:
            fault = _value_fault(load, key, value, cars)
            if fault not in seen:
                seen.add(fault)
                yield f"parameters.{printable(key)} = {shown(value)}: {fault}"


def _telling(values: Values) -> list[Scalar]:
    if isinstance(values, Range):
        return [values.low, values.high]
    if _kind(values[0]) != "number":
        return list(values)
    # A number with a point shows where whole ones are needed.
    fractions = [value for value in values if isinstance(value, float)]
    return list(dict.fromkeys([min(values), max(values), *fractions[:1]]))


def _value_fault(
    load: Load, key: str, value: Scalar, cars: Mapping[str, Sequence[Scalar]]
) -> str | None:
    """Why a value is not allowed, neither alone nor together with a value of another parameter."""
    alone = _fault_of(load, {key: value})
    if alone is None:
        return None
    others = {other: values for other, values in cars.items() if other != key}
    together = [{other: v} for other, values in others.items() for v in values]
    together += [{other: values[end] for other, values in others.items()} for end in (0, -1)]
    for changes in together:
        if _fault_of(load, {**changes, key: value}) is None:
            return None
    return alone


def _fault_of(load: Load, changes: Mapping[str, Any]) -> str | None:
    try:
        load(changes)
    except DataError as error:
        return " ".join(str(error).split())
    return None
