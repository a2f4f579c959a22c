"""The keys of a component that measurements do not give: those of another one, and those given by hand."""

from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any

from hevopt.errors import DataError
from hevopt.files.keypaths import with_changes
from hevopt.files.lookup import find
from hevopt.files.shown import shown
from hevopt.files.toml import FileModel, read_toml

_NOTHING: Mapping[str, tuple[Any, str]] = {}


def unmeasured(
    path: Path,
    model: type[FileModel],
    *,
    like: str | None,
    keys: Collection[str],
    values: Mapping[str, Any],
    measured: Collection[str],
    source: str,
    by_key: Collection[str] = (),
    told: Mapping[str, tuple[Any, str]] = _NOTHING,
) -> tuple[dict[str, Any], dict[str, str]]:
    """Keys and values of a component's file, and where each comes from; `values`, given by hand, go first.

    keys: those that `like` may give, by_key: those of them that are tables whose own keys have origins each
    measured: keys that an import writes from its source, in words; told: key -> (value, origin), before `like`
    Raises DataError for a measured key among the values.
    """
    for key in values:
        if key.split(".")[0] in measured:
            raise DataError(
                f"--set {shown(key)}: that is what the import writes from {source}; leave it out"
            )
    base: dict[str, Any] = {"name": path.stem}
    origins = {"name": "the file's name"}
    if like is not None:
        other = read_toml(find("architectures/components", like, ".toml"), model)
        taken = other.model_dump(exclude_none=True)
        base |= {key: taken[key] for key in keys if key in taken}
        origins |= {key: f"from {like}" for key in keys if key in taken and key not in by_key}
        origins |= {f"{key}.{own}": f"from {like}" for key in by_key for own in taken.get(key, ())}
    for key, (value, origin) in told.items():
        base[key], origins[key] = value, origin
    return with_changes(base, values), origins | dict.fromkeys(values, "given")
