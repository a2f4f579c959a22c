"""Reading a TOML data file through a pydantic model: every fault at once, with file, key, value and range."""

import tomllib
from collections.abc import Iterator
from difflib import get_close_matches
from pathlib import Path
from typing import Any, TypeVar, get_args

from pydantic import BaseModel, ConfigDict, ValidationError
from pydantic.fields import FieldInfo

from hevopt.errors import DataError
from hevopt.files import printable, read_text, shown

_MEGABYTES_MAX = 5
_FAULTS_LISTED = 20
# Tags by which a key takes values of several shapes; they stand in a fault's location, not in the file.
SHAPES = ("a number", "a list", "a table", "a name")
_NEEDED = {
    "model_type": "a table [{place}] is needed",
    "dict_type": "a table [{place}] is needed",
    "list_type": "a list [...] is needed",
    "float_type": "a number is needed",
    "finite_number": "a finite number is needed",
    "int_type": "a whole number is needed",
    "int_from_float": "a whole number is needed",
    "bool_type": "true or false is needed",
    "string_type": 'text in quotes is needed, such as "name"',
    "string_too_short": "needed: {min_length} or more characters",
    "string_too_long": "allowed: up to {max_length} characters",
    "too_short": "needed: {min_length} or more entries",
    "too_long": "allowed: up to {max_length} entries",
    "literal_error": "allowed: {expected}",
    "union_tag_invalid": "allowed: {expected_tags}",
}
_OUT_OF_RANGE = ("greater_than", "greater_than_equal", "less_than", "less_than_equal")


class FileModel(BaseModel):
    """Base of all file models: unknown keys and non-finite numbers are errors, no silent conversion."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False)


Model = TypeVar("Model", bound=FileModel)


def shape_of(value: object) -> str:
    """Which of SHAPES a value has, so that pydantic reports faults against that shape alone."""
    return {list: "a list", dict: "a table"}.get(type(value), "a number")


def read_toml(path: Path, model: type[Model]) -> Model:
    """The file's contents as a checked model."""
    return checked(str(path), read_contents(path), model)


def read_contents(path: Path) -> dict[str, Any]:
    """The file's contents as they stand, keys to values."""
    try:
        return tomllib.loads(read_text(path, _MEGABYTES_MAX))
    except tomllib.TOMLDecodeError as error:
        raise DataError(f"{path}: not valid TOML: {error}") from None
    except ValueError:
        raise DataError(f"{path}: not valid TOML: a number has too many digits") from None
    except RecursionError:
        raise DataError(f"{path}: nested too deeply for a data file") from None


def checked(place: str, contents: dict[str, Any], model: type[Model]) -> Model:
    """Contents as a model; DataError with every fault, `place` in front, where they are not what it allows."""
    try:
        return model.model_validate(contents)
    except ValidationError as error:
        faults = [_fault(model, dict(fault)) for fault in error.errors()]
        head = f"{place}: " if len(faults) == 1 else f"{place}: {len(faults)} faults\n  "
        more = len(faults) - _FAULTS_LISTED
        listed = faults[:_FAULTS_LISTED] + ([f"and {more} more"] if more > 0 else [])
        raise DataError(head + "\n  ".join(listed)) from None


def _fault(model: type[BaseModel], fault: dict[str, Any]) -> str:
    kind, found = fault["type"], fault["input"]
    location = [part for part in fault["loc"] if part not in SHAPES]
    place = ".".join(printable(str(part))[:80] for part in location)
    if kind == "extra_forbidden":
        known = list(_model_and_field(model, location[:-1])[0].model_fields)
        close = get_close_matches(str(fault["loc"][-1]), known, n=2, cutoff=0.5)
        hint = f"close matches: {', '.join(close)}; " if close else ""
        return f"unknown key {place}; {hint}allowed: {', '.join(known)}"
    if kind == "missing":
        return f"{place} is missing; add the key"
    if kind == "value_error":
        message = str(fault["ctx"]["error"])
        if isinstance(found, dict):  # the check of a whole table; its message names keys and values
            return f"{place}: {message}" if place else message
        return f"{place} = {shown(found)}: {message}"
    if kind in _OUT_OF_RANGE:
        field = _model_and_field(model, location)[1]
        return f"{place} = {shown(found)}; allowed: {_range(field)}"
    context = {"place": place, **fault.get("ctx", {})}
    needed = _NEEDED.get(kind, fault["msg"].replace("{", "{{").replace("}", "}}"))
    return f"{place} = {shown(found)}: {needed.format(**context)}"


def _model_and_field(
    model: type[BaseModel], location: list[str | int]
) -> tuple[type[BaseModel], FieldInfo | None]:
    """The model of the table at a location, and the last field on the way there."""
    field = None
    for part in location:
        if part in model.model_fields:
            field = model.model_fields[str(part)]
            model = next(_models_in(field.annotation), model)
    return model, field


def _models_in(annotation: Any) -> Iterator[type[BaseModel]]:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield annotation
    for part in get_args(annotation):
        yield from _models_in(part)


def _range(field: FieldInfo | None) -> str:
    """Both ends of what the numbers of a field may be."""
    ends = {}
    for mark in _marks(field.annotation) + list(field.metadata) if field else []:
        ends |= {end: getattr(mark, end) for end in ("ge", "gt", "le", "lt") if hasattr(mark, end)}
    low = f"above {ends['gt']:g}" if "gt" in ends else f"{ends.get('ge', -float('inf')):g}"
    high = f"below {ends['lt']:g}" if "lt" in ends else f"{ends.get('le', float('inf')):g}"
    return f"{low} to {high}"


def _marks(annotation: Any) -> list[Any]:
    """Bounds of numbers anywhere in an annotation, as those of a list's entries."""
    marks = []
    for part in getattr(annotation, "__metadata__", ()):
        marks += getattr(part, "metadata", [part])
    for part in get_args(annotation):
        marks += _marks(part)
    return marks
