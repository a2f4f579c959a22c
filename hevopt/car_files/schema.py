"""JSON Schema (draft 2020-12) of architecture and component files: types, ranges, units and meanings of all keys.

What a schema cannot say, such as that a list must increase, is checked where the files are read.
"""

from typing import Any

from pydantic.json_schema import models_json_schema

from hevopt.car_files.architecture import ArchitectureFile
from hevopt.car_files.battery import BatteryFile
from hevopt.car_files.car import CarFile
from hevopt.car_files.engine import EngineFile
from hevopt.car_files.gearbox import GearboxFile
from hevopt.car_files.kinds import kind_of
from hevopt.car_files.machine import MachineFile
from hevopt.car_files.meanings import MEANINGS
from hevopt.car_files.source import SourceFile
from hevopt.errors import unknown_name
from hevopt.files.toml import FileModel

# A component in an architecture: its file, or its file and keys in place of the file's.
_NAMED = {
    "type": "string",
    "minLength": 1,
    "description": "a name, looked up in components/ beside the file and then among the shipped ones, or a path",
}
DIALECT = "https://json-schema.org/draft/2020-12/schema"
MODELS: dict[str, type[FileModel]] = {
    "architecture": ArchitectureFile,
    "car": CarFile,
    "engine": EngineFile,
    "source": SourceFile,
    "gearbox": GearboxFile,
    "machine": MachineFile,
    "battery": BatteryFile,
}


def schema(kind: str | None = None) -> dict[str, Any]:
    """The schema of one kind of file, or without a kind that of a file of any."""
    if kind is not None and kind not in MODELS:
        raise unknown_name("kind of file", kind, list(MODELS))
    _, found = models_json_schema([(model, "validation") for model in MODELS.values()])
    tables = {name: _table(name, table) for name, table in found["$defs"].items()}
    parts = {model.__name__ for key, model in MODELS.items() if key != "architecture"}
    tables |= {
        f"{name}Changed": _changed(table, {"file": _NAMED} if name in parts else {})
        for name, table in tables.items()
    }
    references = {key: {"$ref": f"#/$defs/{model.__name__}"} for key, model in MODELS.items()}
    title = f"hevopt {kind or 'architecture or component'} file"
    top = {"anyOf": list(references.values())} if kind is None else references[kind]
    if kind is not None:
        tables = {name: tables[name] for name in _reached(MODELS[kind].__name__, tables)}
    return {"$schema": DIALECT, "title": title, **top, "$defs": tables}


def _table(name: str, table: dict[str, Any]) -> dict[str, Any]:
    """The schema of a table, its keys described; a key that may be left out has no null, which TOML lacks."""
    keys = {}
    for key, found in table["properties"].items():
        unit, meaning = MEANINGS[name][key]
        shapes = [shape for shape in found.get("anyOf", []) if shape != {"type": "null"}]
        if shapes:
            found = {k: value for k, value in found.items() if k != "anyOf"} | shapes[0]
        if found.get("default", "") is None:
            del found["default"]
        found.pop("title", None)
        if any(map(_any_table, found.get("oneOf", []))):
            found = {"oneOf": [_NAMED, _file_and_changes(MODELS[kind_of(key)].__name__)]}
        keys[key] = {"description": f"{meaning} ({unit})" if unit.strip("-") else meaning} | found
        if unit:
            keys[key]["x-unit"] = unit
    return {k: v for k, v in table.items() if k != "title"} | {"properties": keys}


def _any_table(shape: dict[str, Any]) -> bool:
    """Whether a table of whatever keys is meant; pydantic before 2.11 does not say that all are allowed."""
    return (
        shape.get("type") == "object"
        and shape.get("additionalProperties", True) is True
        and "properties" not in shape
    )


def _file_and_changes(name: str) -> dict[str, Any]:
    """A component's file, and keys that replace those of the file."""
    return {
        "type": "object",
        "description": "the file, and keys that replace the file's",
        "required": ["file"],
        "allOf": [{"$ref": f"#/$defs/{name}Changed"}],
    }


def _changed(table: dict[str, Any], besides: dict[str, Any]) -> dict[str, Any]:
    """The schema of what replaces keys of a table: none is needed, and what they are together the file decides."""
    keys = {key: _changed_value(shape) for key, shape in table["properties"].items()}
    return {"type": "object", "additionalProperties": False, "properties": {**besides, **keys}}


def _changed_value(shape: dict[str, Any]) -> dict[str, Any]:
    if "$ref" in shape:
        return {**shape, "$ref": f"{shape['$ref']}Changed"}
    if "oneOf" in shape:
        return {**shape, "oneOf": [_changed_value(inner) for inner in shape["oneOf"]]}
    return shape


def _reached(name: str, tables: dict[str, Any]) -> list[str]:
    """The table of a name and those that it refers to, at any depth."""
    names = [name]
    for reached in names:
        text = str(tables[reached])
        names += [n for n in tables if f"'#/$defs/{n}'" in text and n not in names]
    return names


def allowed(shape: dict[str, Any], tables: dict[str, Any]) -> str:
    """What a value may be, in words, by its schema."""
    if "oneOf" in shape:
        return ", or ".join(allowed(inner, tables) for inner in shape["oneOf"])
    if "enum" in shape:
        return "one of " + ", ".join(shape["enum"])
    if "$ref" in shape:
        keys = tables[shape["$ref"].rpartition("/")[2]]["properties"]
        return f"a table of {', '.join(keys)}"
    if "minimum" in shape or "maximum" in shape:
        whole = "whole number, " if shape["type"] == "integer" else ""
        return f"{whole}{shape['minimum']:g} to {shape['maximum']:g}"
    if shape["type"] == "array":
        return f"a list, each {allowed(shape['items'], tables)}"
    return {"boolean": "true or false", "string": "text", "object": "a table"}.get(
        shape["type"], f"a {shape['type']}"
    )
