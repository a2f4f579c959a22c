"""Reading a TOML data file through a pydantic model: every fault at once, with file, key, value and range."""

import tomllib
from difflib import get_close_matches
from pathlib import Path
from typing import TypeVar

from pydantic import BaseModel, ConfigDict, ValidationError

from hevopt.errors import DataError
from hevopt.files import read_text


class FileModel(BaseModel):
    """Base of all file models: unknown keys and non-finite numbers are errors, no silent conversion."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False)


Model = TypeVar("Model", bound=FileModel)


def read_toml(path: Path, model: type[Model]) -> Model:
    """The file's contents as a checked model."""
    try:
        contents = tomllib.loads(read_text(path))
    except tomllib.TOMLDecodeError as error:
        raise DataError(f"{path}: not valid TOML: {error}") from None
    except RecursionError:
        raise DataError(f"{path}: nested too deeply for a data file") from None
    try:
        return model.model_validate(contents)
    except ValidationError as error:
        faults = [_fault(model, dict(fault)) for fault in error.errors()]
        head = f"{path}: " if len(faults) == 1 else f"{path}: {len(faults)} faults\n  "
        raise DataError(head + "\n  ".join(faults)) from None


def _fault(model: type[BaseModel], fault: dict) -> str:
    place = ".".join(str(part) for part in fault["loc"]) or "file"
    if fault["type"] == "extra_forbidden":
        known = list(_model_at(model, fault["loc"][:-1]).model_fields)
        close = get_close_matches(str(fault["loc"][-1]), known, n=2, cutoff=0.5)
        hint = f"close matches: {', '.join(close)}; " if close else ""
        return f"unknown key {place}; {hint}allowed: {', '.join(known)}"
    if fault["type"] == "missing":
        return f"{place} is missing; add the key"
    found = repr(fault["input"])
    found = found if len(found) <= 60 else found[:57] + "..."
    return f"{place} = {found}: {fault['msg'][0].lower()}{fault['msg'][1:]}"


def _model_at(model: type[BaseModel], location: tuple) -> type[BaseModel]:
    for part in location:
        field = model.model_fields.get(str(part))
        for candidate in (field.annotation, *getattr(field.annotation, "__args__", ())):
            if isinstance(candidate, type) and issubclass(candidate, BaseModel):
                model = candidate
                break
    return model
