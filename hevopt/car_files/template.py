"""A commented copy of an architecture to edit: every key with meaning, unit and range, sources kept.

Lines that begin with `#:` are written here and left out when such a file is copied in turn; the others are kept.
"""

import os
import re
import shlex
import textwrap
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import tomlkit
from tomlkit import items
from tomlkit.container import Container
from tomlkit.exceptions import TOMLKitError

from hevopt.car_files import schema as file_schema
from hevopt.car_files.kinds import COMPONENTS, kind_of
from hevopt.car_files.load import component_contents, load_architecture
from hevopt.car_files.meanings import MEANINGS
from hevopt.car_files.written_out import written_out
from hevopt.errors import DataError, unknown_name
from hevopt.files.lookup import grouped_names, read_text, shipped_folder, shipped_names
from hevopt.files.shown import printable, shown
from hevopt.files.toml import read_contents

_OURS = "#:"
_WIDTH = 110
_MEGABYTES_MAX = 5
_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]{0,59}")
_EXAMPLES = {
    "EngineFile": "{ displacement = 1.25 }",
    "MachineFile": "{ power = 1.25 }",
    "BatteryFile": "{ capacity = 1.25 }",
}


class Notes(NamedTuple):
    """Comments of a file: those at its top; key path -> lines above a key, and the one beside it."""

    top: list[str]
    above: dict[tuple[str, ...], list[str]]
    beside: dict[tuple[str, ...], str]


def new_files(
    name: str,
    like: str | Path,
    out: Path | None = None,
    components: Sequence[str] = (),
    *,
    parts: bool = False,
) -> dict[Path, str]:
    """File -> contents of a copy of an architecture under another name, by default NAME.toml.

    components: which of them get a file of their own to edit, in components/ beside it; ["all"] for every one.
    parts: write the coupling out as the parts that its kind stands for
    Raises DataError for a name that is none or is shipped, and where a file is there already.
    """
    out = Path(f"{name}.toml") if out is None else out
    _check_name(name, out)
    copied = _wanted(components)
    car = load_architecture(like)
    original = car.source
    contents, texts = read_contents(original), {}
    if parts:
        contents = {**contents, "coupling": written_out(car.driveline)}
    references: dict[str, str | dict[str, Any]] = {}
    for key in filter(contents.get, COMPONENTS):
        found = component_contents(original, key, contents[key], {})
        if key in copied:
            references[key] = own = f"{name}_{key}"
            target = out.parent / "components" / f"{own}.toml"
            texts[target] = _component_text(name, key, found.file, found.contents)
        else:
            references[key] = _reference(contents[key], found.file, out.parent)
    texts[out] = _architecture_text(
        name, out, original, {**contents, "name": name, **references}, copied
    )
    for path in texts:
        if path.exists() or path.is_symlink():
            raise DataError(
                f"{path} is there already; nothing was written; choose another name or place"
            )
    return texts


def _check_name(name: str, out: Path) -> None:
    if not _NAME.fullmatch(name):
        raise DataError(
            f"architecture name {shown(name)}; allowed: up to 60 letters, digits, - and _, the first a "
            "letter or digit; --out says where the file goes"
        )
    shipped = shipped_names("architectures", ".toml") + grouped_names("architectures", ".toml")
    if name.lower() in (other.lower() for other in shipped):
        raise DataError(
            f"architecture name {name} is that of a shipped one ({', '.join(shipped)}); choose another"
        )
    if out.suffix != ".toml":
        raise DataError(f"--out {printable(str(out))}; an architecture is a .toml file")


def _wanted(components: Sequence[str]) -> list[str]:
    if list(components) == ["all"]:
        return list(COMPONENTS)
    for key in components:
        if key == "all":
            raise DataError(
                f"--components {printable(','.join(components))}: all stands alone; leave the others out"
            )
        if key not in COMPONENTS:
            raise unknown_name("component", key, [*COMPONENTS, "all"])
    return list(components)


def _reference(component: str | dict[str, Any], file: Path, folder: Path) -> str | dict[str, Any]:
    """A component's value in a file that lies in another folder: by name where shipped, else by path."""
    shipped = file.parent.resolve() == (shipped_folder("architectures") / "components").resolve()
    if shipped and not (folder / "components" / file.name).is_file():
        name = file.stem
    else:
        name = Path(os.path.relpath(file.resolve(), folder.resolve())).as_posix()
        name = name if "/" in name else f"./{name}"
    return name if isinstance(component, str) else {**component, "file": name}


def _architecture_text(
    name: str, out: Path, original: Path, contents: Mapping[str, Any], copied: Sequence[str]
) -> str:
    notes = _notes(original)
    path = shlex.quote(out.as_posix() if "/" in out.as_posix() else f"./{out.as_posix()}")
    head = [
        f"{name}: an architecture for hevopt, copied from {original.stem}.",
        f"When edited:  hevopt validate {path}",
        f"              hevopt compare --architectures A,{path}",
        "Above each key: meaning, unit, allowed range. Behind a value: its source as in the file copied,",
        "[S] published, [F] fitted to published data, [E] estimate; mark yours. Unknown keys are errors.",
    ]
    lines = [f"{_OURS} {line}" for line in head]
    lines += _kept(original, notes)
    body = _table_lines("ArchitectureFile", contents, notes, (), file_schema.schema()["$defs"])
    at = next(n for n, line in enumerate(body) if line.startswith("car = "))
    while at > 0 and body[at - 1].startswith("#"):
        at -= 1
    explained = [*_component_help(name, path, copied), ""]
    return "\n".join([*lines, "", *body[:at], *explained, *body[at:]]) + "\n"


def _component_help(name: str, path: str, copied: Sequence[str]) -> list[str]:
    """What the value of a component may be, and how its size is scaled."""
    scale = MEANINGS["EngineFile"]["scale"][1]
    lines = [
        "The components. Each is a file's name, a path, or one of the two with keys replaced:",
        '  engine = "engine_diesel_1600"         in components/ beside this file, else shipped',
        '  engine = "./my_engine.toml"           a path from here',
        '  engine = { file = "engine_diesel_1600", start_fuel_g = 0.3, fuel = { density_kgpl = 0.84 } }',
        '  engine = { file = "engine_diesel_1600", scale = { displacement = 1.25 } }',
        *textwrap.wrap(f"scale: {scale}; a machine likewise.", _WIDTH - 4),
    ]
    rest = [key for key in ("car", "battery") if key not in copied]
    if rest:
        lines.append(
            f"A component as a file to edit: hevopt architectures new {name}2 --like {path} "
            f"--components {rest[0]}"
        )
    return [f"{_OURS} {line}" for line in lines]


def _component_text(name: str, key: str, original: Path, contents: Mapping[str, Any]) -> str:
    notes = _notes(original)
    head = [
        f"{_OURS} The {key} of {name}, copied from {original.name}. Above each key: meaning, unit, allowed range.",
        *_kept(original, notes),
        "",
    ]
    tables = file_schema.schema()["$defs"]
    model = file_schema.MODELS[kind_of(key)].__name__
    return "\n".join([*head, *_table_lines(model, contents, notes, (), tables)]) + "\n"


def _kept(original: Path, notes: Notes) -> list[str]:
    return [f"{_OURS} From {original.name}:", *notes.top] if notes.top else []


def _table_lines(
    model: str,
    contents: Mapping[str, Any],
    notes: Notes,
    at: tuple[str, ...],
    tables: dict[str, Any],
) -> list[str]:
    """A table's keys in the order of its model, its own values before the tables in it."""
    lines, sections = [], []
    for key, shape in tables[model]["properties"].items():
        unit, meaning = MEANINGS[model][key]
        path, inner = (*at, key), _inner_table(shape)
        allowed = file_schema.allowed(shape, tables)
        if at == () and model == "ArchitectureFile" and key in COMPONENTS:
            allowed = f"shipped: {', '.join(_shipped_components(key)) or 'none'}"
        said = f"{meaning}{f' ({unit})' if unit.strip('-') else ''}; {allowed}"
        if key not in contents:
            default = f", by default {toml_value(shape['default'])}" if "default" in shape else ""
            lines += _comment(f"Not given{default}: {key}: {said}")
            if key == "scale":
                lines.append(f"{_OURS} scale = {_EXAMPLES[model]}")
            continue
        value = contents[key]
        above, beside = notes.above.get(path, []), notes.beside.get(path, "")
        sources = (beside, above, notes.beside.get(at), notes.above.get(at))
        if unit and not any(sources):
            beside = "# no source named"
        beside = f"  {beside}" if beside else ""
        if inner and isinstance(value, Mapping):
            said = said.partition("; a table of")[0]
            sections += ["", *above, *_comment(said), f"[{'.'.join(path)}]{beside}"]
            sections += _table_lines(inner, value, notes, path, tables)
        else:
            lines += [*above, *_comment(said), f"{key} = {toml_value(value)}{beside}"]
    return lines + sections


def _shipped_components(key: str) -> list[str]:
    folder = shipped_folder("architectures") / "components"
    return sorted(path.stem for path in folder.glob(f"{kind_of(key)}_*.toml"))


def _inner_table(shape: Mapping[str, Any]) -> str | None:
    """The model of the table that a key may be."""
    found = [s["$ref"] for s in (shape, *shape.get("oneOf", [])) if "$ref" in s]
    return found[0].rpartition("/")[2] if found else None


def _comment(text: str) -> list[str]:
    return [f"{_OURS} {line}" for line in textwrap.wrap(text, _WIDTH - 3)]


def toml_value(value: Any) -> str:
    """A value as TOML, long lists over several lines."""
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{_key(k)} = {toml_value(v)}" for k, v in value.items()) + " }"
    if not isinstance(value, list):
        return str(tomlkit.item(value).as_string())
    inner = [toml_value(entry) for entry in value]
    if any(isinstance(entry, list | Mapping) for entry in value):
        return "[\n" + "".join(f"  {row},\n" for row in inner) + "]"
    text = ", ".join(inner)
    if len(text) <= _WIDTH:
        return f"[{text}]"
    rows = textwrap.wrap(text, _WIDTH - 4, break_long_words=False, break_on_hyphens=False)
    return "[\n" + "".join(f"  {row}\n" for row in rows) + "]"


def _key(key: str) -> str:
    return tomlkit.key(key).as_string()


def _notes(path: Path) -> Notes:
    """The comments of a TOML file by what they belong to, without those of `new_files`."""
    notes = Notes([], {}, {})
    pending: list[str] = []
    try:
        document = tomlkit.parse(read_text(path, _MEGABYTES_MAX))
    except TOMLKitError as error:
        raise DataError(f"{path}: its comments cannot be read: {error}") from None
    _gather(document, (), notes, pending)
    return notes


def _gather(container: Container, at: tuple[str, ...], notes: Notes, pending: list[str]) -> None:
    for key, item in container.body:
        if isinstance(item, items.Comment):
            line = item.as_string().strip()
            pending += [] if line.startswith(_OURS) else [line]
        elif key is not None:
            path = (*at, key.key)
            if not notes.above:
                notes.top.extend(pending)
                pending.clear()
            notes.above[path] = list(pending)
            notes.beside[path] = item.trivia.comment
            pending.clear()
            if isinstance(item, items.Table):
                _gather(item.value, path, notes, pending)
