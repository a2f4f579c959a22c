"""Where data files are: a name or a path, from any working directory.

A path is anything with a separator or a suffix; it is taken as it stands. A name is looked up among the
shipped files, which lie inside the installed package, or beside it in a checkout.
"""

import json
import re
import stat
from collections import Counter
from collections.abc import Callable, Iterable
from functools import cache
from pathlib import Path
from typing import Any

from hevopt.errors import DataError, close_to, unknown_name
from hevopt.files.shown import encodable, printable, shown

_PACKAGE = Path(__file__).resolve().parents[1]
_FOLDERS_MAX = 10
# In quotes folders may have spaces.
_ABSOLUTE = re.compile(
    r"""(?<=')/(?:[^/'<>\n]+/)+(?=[^/'\n]*')|(?<=")/(?:[^/"<>\n]+/)+(?=[^/"\n]*")"""
    r"""|(?<![\w.~/<>-])/(?:[^\s/'":;,<>]+/)+"""
)
# Two of these make one character, one alone cannot be written.
_HALF_CHARACTER = re.compile(r"\\u[dD][89a-fA-F]")
# Kind -> part of a name that people use -> shipped files of which that may speak.
_ALSO_CALLED = {
    "cycles": {
        "wltp": "wltc_class3b", "wltc": "wltc_class3b", "gtr15": "wltc_class3b",
        "cadc": "cadc_urban cadc_road cadc_motorway130", "artemis": "cadc_urban cadc_road cadc_motorway130",
        "ftp": "ftp75 udds", "epa75": "ftp75", "epacity": "udds ftp75", "udds": "udds", "la4": "udds",
        "fhds": "hwfet", "hwfet": "hwfet", "hwy": "hwfet", "highway": "hwfet", "us06": "us06",
        "nedc": "nedc", "mveg": "nedc", "ece15": "nedc", "eudc": "nedc",
    },
}  # fmt: skip


@cache
def shipped_folder(kind: str) -> Path:
    """The folder of the shipped files of a kind: 'architectures' or 'cycles'."""
    installed = _PACKAGE / "data" / kind
    return installed if installed.is_dir() else _PACKAGE.parent / kind


def place_shown(path: Path, beside: Path | None = None) -> str:
    """A file as a report names it: a shipped one by its place among them, wherever they are installed.

    Others as they were written, or from a folder on; an absolute one by its name alone, for a report may be handed
    on and folders are the user's.
    """
    for root in filter(None, (shipped_folder("architectures").parent, beside)):
        if path.is_relative_to(root):
            return printable(path.relative_to(root).as_posix())
    return printable(path.name if path.is_absolute() else str(path))


def places_shown(paths: Iterable[Path], beside: Path | None = None) -> dict[Path, str]:
    """`place_shown` of each file; those of one name with as many of their folders as tell them apart."""
    names = {path: place_shown(path, beside) for path in paths}
    for parts in range(2, _FOLDERS_MAX):
        counts = Counter(names.values())
        alike = [path for path, name in names.items() if counts[name] > 1]
        if not alike:
            return names
        names |= {path: printable("/".join(path.parts[-parts:])) for path in alike}
    counts, seen = Counter(names.values()), Counter[str]()
    for path, name in names.items():
        seen[name] += 1
        names[path] = f"{name} ({seen[name]})" if counts[name] > 1 else name
    return names


def without_folders(text: str) -> str:
    """The text with absolute paths as the names of their files."""
    return _ABSOLUTE.sub("", text)


def shipped_names(kind: str, suffix: str) -> list[str]:
    """Names of the shipped files of a kind, sorted."""
    return sorted(p.stem for p in shipped_folder(kind).glob(f"*{suffix}"))


def grouped_names(kind: str, suffix: str) -> list[str]:
    """Names of the shipped files in groups of a kind, which stand for no comparison unless they are named."""
    return [name for names in groups_of(kind, suffix).values() for name in names]


def groups_of(kind: str, suffix: str) -> dict[str, list[str]]:
    """Group -> names of its shipped files, sorted."""
    return {folder.name: _names_in(folder, suffix) for folder in _groups(kind)}


def _groups(kind: str) -> list[Path]:
    """Folders of a kind beside that of its components."""
    folders = shipped_folder(kind).iterdir() if shipped_folder(kind).is_dir() else ()
    return sorted(f for f in folders if f.is_dir() and f.name != "components")


def is_path(text: str, suffix: str) -> bool:
    """Whether a text means a file where it stands, rather than the name of one."""
    return "/" in text or "\\" in text or text.endswith(suffix)


def find(
    kind: str,
    name: str | Path,
    suffix: str,
    beside: Path | None = None,
    fits: Callable[[str], bool] = lambda name: True,
) -> Path:
    """The file for a name or a path; `beside` is a folder searched before the shipped ones.

    fits: which names a message may propose
    """
    text, word = str(name), Path(kind).name.removesuffix("s")
    if not text.strip() or "\0" in text:
        raise DataError(f"{word} name {text!r} is empty or not a name; give a name or a path")
    try:
        if is_path(text, suffix):
            return _file_at(text, kind, word, suffix, beside, fits)
        for folder in filter(None, (beside, shipped_folder(kind), *_groups(kind))):
            if (folder / f"{text}{suffix}").is_file():
                return folder / f"{text}{suffix}"
    except OSError as error:
        raise DataError(
            f"{word} {shown(text)} cannot be looked up ({error.strerror}); check the name or path"
        ) from None
    known = [*_names_in(beside, suffix), *shipped_names(kind, suffix), *grouped_names(kind, suffix)]
    known = list(filter(fits, dict.fromkeys(known)))
    raise unknown_name(word, text, known, meant_by(kind, text))


def meant_by(kind: str, name: str) -> list[str]:
    """Shipped files that are also called something like a name, such as wltc_class3b for WLTP."""
    plain = "".join(letter for letter in name.lower() if letter.isalnum())
    found = [names for part, names in _ALSO_CALLED.get(kind, {}).items() if part in plain]
    return list(dict.fromkeys(name for names in found for name in names.split()))


def _names_in(folder: Path | None, suffix: str) -> list[str]:
    return [] if folder is None else sorted(printable(p.stem) for p in folder.glob(f"*{suffix}"))


def _file_at(
    text: str,
    kind: str,
    word: str,
    suffix: str,
    beside: Path | None,
    fits: Callable[[str], bool],
) -> Path:
    path, text = Path(text), printable(text)
    for candidate in (beside / path, path) if beside else (path,):
        if candidate.is_file():
            return candidate
    if path.is_dir():
        raise DataError(f"{word} file {text} is a folder; give the path of a {suffix} file")
    if path.exists():
        raise DataError(f"{word} file {text} is not a regular file; give a {suffix} file or a name")
    there = _names_in((beside or Path()) / path.parent, suffix)
    hint = close_to(path.stem, filter(fits, there), what="there with a close name")
    meant = meant_by(kind, path.stem)
    shipped = filter(fits, shipped_names(kind, suffix))
    hint += close_to(path.stem, shipped, meant, what="shipped with a close name")
    raise DataError(
        f"{word} file {text} does not exist; {hint}give the path of a {suffix} file or a name"
    )


def check_regular(path: Path) -> None:
    """DataError where a path is no file that ends: nothing, a folder, or a pipe or device, which may never end."""
    try:
        mode = path.stat().st_mode
    except (OSError, ValueError) as error:
        raise DataError(f"{path}: cannot be read ({_reason(error)}); check the path") from None
    if not stat.S_ISREG(mode):
        what = "a folder" if stat.S_ISDIR(mode) else "a pipe or a device"
        raise DataError(f"{path}: {what}, not a regular file; give a file")


def read_bytes(path: Path, megabytes_max: int) -> bytes:
    """Contents of a regular file of up to so many MB; DataError for anything else."""
    check_regular(path)
    most = megabytes_max * 1_000_000
    try:
        size = path.stat().st_size
        with path.open("rb") as file:
            contents = file.read(most + 1) if size <= most else b""
    except OSError as error:
        raise DataError(f"{path}: cannot be read ({error.strerror}); check the path") from None
    # A file such as those of /proc may hold more than it says.
    if max(size, len(contents)) > most:
        kind = f" for a {path.suffix} file" if path.suffix else ""
        raise DataError(
            f"{path}: {max(size, len(contents)) / 1e6:.1f} MB; allowed: up to {megabytes_max} MB{kind}; give a "
            "smaller file"
        )
    return contents


def starts_with(path: Path, mark: bytes) -> bool:
    """Whether a regular file begins with these bytes; DataError where it cannot be read."""
    check_regular(path)
    try:
        with path.open("rb") as file:
            return file.read(len(mark)) == mark
    except OSError as error:
        raise DataError(f"{path}: cannot be read ({error.strerror}); check the path") from None


def _reason(error: OSError | ValueError) -> str:
    return getattr(error, "strerror", None) or "not a path"


def read_text(path: Path, megabytes_max: int) -> str:
    """Contents of a text file; DataError where it cannot be read as UTF-8 text."""
    try:
        return (
            read_bytes(path, megabytes_max)
            .decode("utf-8-sig")
            .replace("\r\n", "\n")
            .replace("\r", "\n")
        )
    except UnicodeDecodeError as error:
        raise DataError(
            f"{path}: byte {error.start} is not UTF-8 text; save the file as UTF-8"
        ) from None


def dumped_json(contents: Any) -> str:
    """Compact JSON that `loaded_json` reads: half characters, of names that are no UTF-8, as Python spells them."""
    text = json.dumps(contents, allow_nan=False, separators=(",", ":"))
    if _HALF_CHARACTER.search(text):
        return json.dumps(_encodable(contents), allow_nan=False, separators=(",", ":"))
    return text


def _encodable(value: Any) -> Any:
    if isinstance(value, dict):
        return {encodable(key): _encodable(inner) for key, inner in value.items()}
    if isinstance(value, list):
        return [_encodable(inner) for inner in value]
    return encodable(value) if isinstance(value, str) else value


def loaded_json(text: str) -> Any:
    """What a JSON text holds; ValueError or RecursionError where it is none, or half a character stands in it."""
    contents = json.loads(text)
    if _HALF_CHARACTER.search(text):
        json.dumps(contents, ensure_ascii=False).encode()
    return contents
