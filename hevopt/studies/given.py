"""What a comparison is given, by a study file, options or keywords, checked, and the settings that come of it."""

from collections.abc import Mapping
from dataclasses import fields
from numbers import Real
from typing import Any, get_type_hints

import numpy as np
from pydantic import Field, create_model

from hevopt.car_files import fields as of_files
from hevopt.car_files.kinds import COMPONENTS
from hevopt.errors import DataError, unknown_name
from hevopt.files.shown import printable, shown
from hevopt.files.toml import FileModel, checked
from hevopt.studies import allowed
from hevopt.studies.settings import KEYS, Keywords, Settings, Study


def _file_fields() -> dict[str, Any]:
    """Key of a study file -> its type and default: those of the settings, changes as the table [set]."""
    hints = get_type_hints(Settings, vars(of_files) | vars(allowed), include_extras=True)
    own = {f.name: (hints[f.name], f.default) for f in fields(Settings) if f.name != "changes"}
    return own | {"set": (dict[str, Any], Field(default_factory=dict))}


CompareFile = create_model(
    "CompareFile",
    __base__=FileModel,
    __doc__="A study file of compare: cycle, architectures, and a key for every setting.",
    cycle=(str, "nedc"),
    architectures=(allowed.Names | None, None),
    **_file_fields(),
)


def given_of(place: str, contents: Mapping[str, Any]) -> dict[str, Any]:
    """Keys and values of a study as they are given, checked, its `set` as key path -> value.

    `place` is how a message names where they stand. DataError with every fault.
    """
    checked(place, dict(contents), CompareFile)
    changes = flat_changes(contents.get("set", {}))
    for name, key in KEYS.items():
        if name in contents and key in changes:
            raise DataError(f"{place}: {name} and set {key} are one; leave one of them out")
    return {**contents, "set": changes}


def joined(below: Mapping[str, Any], over: Mapping[str, Any]) -> dict[str, Any]:
    """What two places give, both as `given_of` has it, the second on top."""
    kept = {name: value for name, value in below.items() if KEYS.get(name) not in over["set"]}
    replaced = {KEYS[name] for name in over if name in KEYS}
    changes = {key: value for key, value in below["set"].items() if key not in replaced}
    return {**kept, **over, "set": {**changes, **over["set"]}}


def study_of(given: Mapping[str, Any]) -> Study:
    """The comparison of what is given, as `given_of` has it, and the default of what is not."""
    file: Any = CompareFile.model_validate(dict(given))
    own = {f.name: getattr(file, f.name) for f in fields(Settings) if f.name != "changes"}
    return Study(file.cycle, file.architectures, Settings(**own, changes=file.set))


def settings_from(place: str, keywords: Mapping[str, Any], **own: Any) -> Settings:
    """Settings of a function's keywords, and of what that function knows itself; None is what is not given.

    place: names the function. DataError for a keyword that is no setting, with those that are, and a wrong value.
    """
    known = list(Keywords.__annotations__)
    for name in keywords:
        if name not in known:
            raise DataError(f"{place}: {unknown_name('setting', printable(name), known)}")
    given = {
        name: _plain(value) for name, value in {**keywords, **own}.items() if value is not None
    }
    changes = given.pop("changes", {})
    if not isinstance(changes, Mapping):
        raise DataError(
            f"{place}: changes = {shown(changes)}; needed: a mapping of key path to value"
        )
    return study_of(given_of(place, {**given, "set": dict(changes)})).settings


def _plain(value: Any) -> Any:
    """A number of NumPy as Python's own; everything else as it is."""
    return value.item() if isinstance(value, Real | np.bool_) and hasattr(value, "item") else value


def flat_changes(table: Mapping[str, Any], at: str = "") -> dict[str, Any]:
    """Key path -> value of nested tables; of a component given as a table, its file and what replaces its keys."""
    flat: dict[str, Any] = {}
    for key, value in table.items():
        path = f"{at}.{key}" if at else key
        leaves = {path: value}
        if isinstance(value, dict) and value:
            inner = dict(value)
            file = {path: inner.pop("file")} if path in COMPONENTS and "file" in inner else {}
            leaves = file | flat_changes(inner, path)
        for found, leaf in leaves.items():
            if found in flat:
                raise DataError(f"set {printable(found)} is given twice; leave one out")
            flat[found] = leaf
    return flat
