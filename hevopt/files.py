"""Where data files are: a name or a path, from any working directory.

A path is anything with a separator or a suffix; it is taken as it stands. A name is looked up among the
shipped files, which lie inside the installed package, or beside it in a checkout.
"""

from pathlib import Path

from hevopt.errors import DataError, unknown_name

_PACKAGE = Path(__file__).resolve().parent
_SIZE_LIMIT_BYTES = 100_000_000


def shipped_folder(kind: str) -> Path:
    """The folder of the shipped files of a kind: 'architectures' or 'cycles'."""
    installed = _PACKAGE / "data" / kind
    return installed if installed.is_dir() else _PACKAGE.parent / kind


def shipped_names(kind: str, suffix: str) -> list[str]:
    """Names of the shipped files of a kind, sorted."""
    return sorted(p.stem for p in shipped_folder(kind).glob(f"*{suffix}"))


def find(kind: str, name: str | Path, suffix: str, beside: Path | None = None) -> Path:
    """The file for a name or a path; `beside` is a folder searched before the shipped ones."""
    text = str(name)
    if not text.strip() or "\0" in text:
        raise DataError(f"{kind} name {text!r} is empty or not a name; give a name or a path")
    path = Path(text)
    if len(path.parts) > 1 or path.suffix == suffix:
        candidates = [path if path.is_absolute() or beside is None else beside / path]
        if beside is not None:
            candidates.append(path)
        for candidate in candidates:
            if candidate.is_file():
                return candidate
        what = "is a folder" if path.is_dir() else "does not exist"
        raise DataError(f"{kind} file {text} {what}; give the path of a {suffix} file or a name")
    for folder in filter(None, (beside, shipped_folder(kind))):
        candidate = folder / f"{text}{suffix}"
        if candidate.is_file():
            return candidate
    raise unknown_name(kind.removesuffix("s"), text, shipped_names(kind, suffix))


def read_text(path: Path) -> str:
    """Contents of a text file; DataError where it cannot be read as UTF-8 text."""
    try:
        if path.stat().st_size > _SIZE_LIMIT_BYTES:
            raise DataError(
                f"{path}: {path.stat().st_size / 1e6:.0f} MB, more than the "
                f"{_SIZE_LIMIT_BYTES / 1e6:.0f} MB allowed for a data file"
            )
        return path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError as error:
        raise DataError(
            f"{path}: byte {error.start} is not UTF-8 text; save the file as UTF-8"
        ) from None
    except OSError as error:
        raise DataError(f"{path}: cannot be read ({error.strerror}); check the path") from None
