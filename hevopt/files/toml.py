"""Reading a TOML data file through a pydantic model: every fault at once, with file, key, value and range."""

import re
import tomllib
from collections.abc import Iterator
from copy import deepcopy
from functools import lru_cache
from pathlib import Path
from typing import Any, TypeVar, get_args

from pydantic import BaseModel, ConfigDict, ValidationError, create_model
from pydantic.fields import FieldInfo

from hevopt.errors import DataError, close_to
from hevopt.files.lookup import read_text
from hevopt.files.shown import printable, shown

_MEGABYTES_MAX = 5
_FAULTS_LISTED = 20
_DEPTH_MAX, _KEYS_MAX = 20, 5000
# Ten or more parts joined by dots: reading thousands of them takes the memory of the machine.
_PART = r"""(?:[A-Za-z0-9_-]+|"[^"\n]*"|'[^'\n]*')"""
_LONG_KEY_PATH = re.compile(rf"(?<![A-Za-z0-9_-]){_PART}(?:[ \t]*\.[ \t]*{_PART}){{9}}")
# Signs of a key or a table's header; there are a few more where comments or texts hold them.
_KEY_OR_HEADER = re.compile(r"=|^[ \t]*\[[^\],\n]*\.[^\],\n]*\.", re.MULTILINE)
_DOUBLED = re.compile(r"Cannot overwrite a value \(at (?:line (?P<line>\d+), column \d+|.*)\)")
_TUPLE = re.compile(r"\((?:'[^']*'(?:, |,|(?=\))))+\)")
_KEY_IN_LINE = re.compile(rf"[ \t]*(?:\[+[^\]\n]+\]+|{_PART}(?:[ \t]*\.[ \t]*{_PART})*[ \t]*=)")
# Tags by which a key takes values of several shapes; they stand in a fault's location, not in the file.
SHAPES = ("a number", "a list", "a table", "a name")
_NEEDED = {
    "model_type": "a table [{place}] is needed",
    "dict_type": "a table [{place}] is needed",
    "list_type": "a list [...] is needed",
    "tuple_type": "a list [...] is needed",
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

    # Built when a file is first checked: most models are parts of others, or of files that a command never reads.
    model_config = ConfigDict(
        extra="forbid", strict=True, frozen=True, allow_inf_nan=False, defer_build=True
    )


Model = TypeVar("Model", bound=FileModel)


def shape_of(value: object) -> str:
    """Which of SHAPES a value has, so that pydantic reports faults against that shape alone."""
    shapes: dict[type, str] = {list: "a list", dict: "a table"}
    return shapes.get(type(value), "a number")


def read_toml(path: Path, model: type[Model]) -> Model:
    """The file's contents as a checked model."""
    return checked(str(path), read_contents(path), model)


def read_contents(path: Path) -> dict[str, Any]:
    """The file's contents as they stand, keys to values."""
    if path.exists() and not path.is_file() and not path.is_dir():
        raise DataError(f"{path}: not a regular file; give a {path.suffix or '.toml'} file")
    return deepcopy(_parsed(path, read_text(path, _MEGABYTES_MAX)))


@lru_cache(maxsize=16)
def _parsed(path: Path, text: str) -> dict[str, Any]:
    """What a text holds: of a sweep's designs, thousands are made of the same few files."""
    too_deep = f"{path}: nested too deeply for a data file"
    if _LONG_KEY_PATH.search(text):
        raise DataError(too_deep)
    if sum(1 for _ in _KEY_OR_HEADER.finditer(text)) > 4 * _KEYS_MAX:
        raise DataError(f"{path}: too many keys; allowed: up to {_KEYS_MAX} in a data file")
    try:
        contents = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise DataError(f"{path}: not valid TOML: {_said(str(error), text)}") from None
    except ValueError:
        raise DataError(f"{path}: not valid TOML: a number has too many digits") from None
    except RecursionError:
        raise DataError(too_deep) from None
    level: list[dict[str, Any] | list[Any]] = [contents]
    keys = 0
    for _ in range(_DEPTH_MAX):
        keys += sum(len(table) for table in level if isinstance(table, dict))
        inner = (v.values() if isinstance(v, dict) else v for v in level)
        level = [e for entries in inner for e in entries if isinstance(e, dict | list)]
    if level:
        raise DataError(too_deep)
    if keys > _KEYS_MAX:
        raise DataError(f"{path}: {keys} keys; allowed: up to {_KEYS_MAX} in a data file")
    return contents


def _said(message: str, text: str) -> str:
    """What the TOML reader says, with the key where it names the place behind a doubled one only."""
    found = _DOUBLED.fullmatch(message)
    if not found:  # key paths stand there as Python tuples
        return _TUPLE.sub(lambda key: ".".join(re.findall("'([^']*)'", key[0])), message)
    lines = text.splitlines()
    last = int(found["line"] or len(lines))
    keys = [(n, key) for n, line in enumerate(lines[:last], 1) if (key := _KEY_IN_LINE.match(line))]
    if not keys:
        return message
    line, key = keys[-1]
    return f"{printable(key[0].strip(' ='))} is given twice (line {line}); leave one out"


def checked(place: str, contents: dict[str, Any], model: type[Model]) -> Model:
    """Contents as a model; DataError with every fault, `place` in front, where they are not what it allows."""
    try:
        return model.model_validate(contents)
    except ValidationError:
        count, faults = faults_of(contents, model, _FAULTS_LISTED)
    raise DataError.of(place, faults, count)


def faults_of(contents: dict[str, Any], model: type[BaseModel], most: int) -> tuple[int, list[str]]:
    """How many faults some contents have, and the first of them, each with key path, value and what is allowed."""
    found = _all_faults(model, contents, ())
    return len(found), [_fault(model, fault) for fault in found[:most]]


def good_keys(contents: dict[str, Any], model: type[BaseModel]) -> dict[str, Any]:
    """What of some contents has no fault by itself, for checks that go beyond the model."""
    try:
        model.model_validate(contents)
    except ValidationError as error:
        faulty = {fault["loc"][0] for fault in error.errors(include_url=False) if fault["loc"]}
        return {key: value for key, value in contents.items() if key not in faulty}
    return contents


def _all_faults(
    model: type[BaseModel], table: dict[str, Any], at: tuple[str | int, ...]
) -> list[dict[str, Any]]:
    """pydantic's faults, and those of the checks that it leaves out because some other key is wrong."""
    try:
        model.model_validate(table)
    except ValidationError as error:
        found: list[dict[str, Any]] = [dict(fault) for fault in error.errors(include_url=False)]
    else:
        return []
    faulty = list(dict.fromkeys(str(fault["loc"][0]) for fault in found if fault["loc"]))
    inner = {}
    for name in faulty:
        field = model.model_fields.get(name)
        below = next(_models_in(field.annotation), None) if field else None
        if below is not None and isinstance(table.get(name), dict):
            inner[name] = _all_faults(below, table[name], (*at, name))
    own = [f | {"loc": (*at, *f["loc"])} for f in found if f["loc"] and f["loc"][0] not in inner]
    whole = [{**fault, "loc": at} for fault in _faults_of_checks(model, table, faulty)]
    return [*own, *(fault for faults in inner.values() for fault in faults), *whole]


def _faults_of_checks(
    model: type[BaseModel], table: dict[str, Any], faulty: list[str]
) -> list[dict[str, Any]]:
    """Faults that the checks of a whole table find in its good keys; one that asks for a faulty key is left out."""
    fields = {n: f for n, f in model.model_fields.items() if n not in faulty}
    parts: dict[str, Any] = {name: (field.annotation, field) for name, field in fields.items()}
    good = create_model("Good", __base__=FileModel, **parts).model_validate(
        {name: table[name] for name in fields if name in table}
    )
    partial = model.model_construct(
        set(table) & set(model.model_fields), **{name: getattr(good, name) for name in fields}
    )
    for name in faulty:
        vars(partial).pop(name, None)
    faults = []
    for check in model.__pydantic_decorators__.model_validators.values():
        if check.info.mode != "after":
            continue
        try:
            check.func(partial)
        except AttributeError:
            continue
        except ValueError as error:
            faults.append({"type": "value_error", "input": table, "ctx": {"error": error}})
    return faults


def _fault(model: type[BaseModel], fault: dict[str, Any]) -> str:
    kind, found = fault["type"], fault["input"]
    location = [part for part in fault["loc"] if part not in SHAPES]
    place = ".".join(printable(str(part))[:80] for part in location)
    if kind == "extra_forbidden":
        known = list(_model_and_field(model, location[:-1])[0].model_fields)
        hint = close_to(str(fault["loc"][-1]), known, count=2, cutoff=0.5)
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
    if kind == "literal_error" and isinstance(found, str):
        names = re.findall(r"'([^']*)'", fault["ctx"]["expected"])
        hint = close_to(found, names, count=2, cutoff=0.5)
        return f"{place} = {shown(found)}: {hint}allowed: {fault['ctx']['expected']}"
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
    ends: dict[str, float] = {}
    for mark in _marks(field.annotation) + list(field.metadata) if field else []:
        ends |= {end: getattr(mark, end) for end in ("ge", "gt", "le", "lt") if hasattr(mark, end)}
    low = f"above {ends['gt']:g}" if "gt" in ends else f"{ends.get('ge', -float('inf')):g}"
    high = f"below {ends['lt']:g}" if "lt" in ends else f"{ends.get('le', float('inf')):g}"
    return f"{low} to {high}"


def _marks(annotation: Any) -> list[Any]:
    """Bounds of numbers anywhere in an annotation, as those of a list's entries."""
    marks: list[Any] = []
    for part in getattr(annotation, "__metadata__", ()):
        marks += getattr(part, "metadata", [part])
    for part in get_args(annotation):
        marks += _marks(part)
    return marks
