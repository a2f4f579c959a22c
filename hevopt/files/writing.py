"""Writing a file at once, so that a reader, or a run killed in the middle, never leaves half of one."""

import os
import re
import shutil
import stat
import tempfile
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, Any

from hevopt.errors import DataError
from hevopt.files.shown import printable

# Spreadsheets take text that begins like this for a formula, also behind spaces, and in wide letters.
_SIGN = r"[=+\-@\uff1d\uff0b\uff0d\uff20][\s\S]"
# In place of commas some split lines at other marks, whatever stands in quotes.
_FORMULA = re.compile(rf"^(?=[\s\0\ufeff']*{_SIGN}|'*[\t\r\n])|(?<=[;|\t\r\n])(?='*{_SIGN})")
_FORMULA_IN_COMMENT = re.compile(rf"(?<=[,;|\t])(?=[\s']*{_SIGN})")
_NUMBER = re.compile(r"[+-]?\d+(?:\.\d*)?(?:[eE][+-]?\d+)?")

try:
    import fcntl
except ImportError:  # not on every system
    fcntl = None  # type: ignore[assignment]

_PREFIX = ".hevopt."
# As `tempfile` completes it.
_TEMPORARY = re.compile(r"\.hevopt\.[a-z0-9_]{8}")


def check_writable(path: Path) -> Path:
    """The file that a path stands for, links followed; DataError where `write_whole` could not write it."""
    try:
        target = path.resolve()
        if target.is_dir():
            fault = "Is a folder"
        elif target.exists() and not target.is_file():
            fault = "Not a regular file"
        elif target.exists() and not os.access(target, os.W_OK):
            fault = "Read-only file"
        elif not target.parent.is_dir():
            fault = "No such folder"
        elif not os.access(target.parent, os.W_OK):
            fault = "Read-only folder"
        else:
            return target
    except OSError as error:
        fault = str(error.strerror)
    except RuntimeError:
        fault = "Links in a circle"
    raise DataError(f"{path}: cannot be written ({fault}); choose another place")


@dataclass(frozen=True, slots=True)
class Asked:
    """Files that a command was asked for, and those of them and others that are written; paths as given."""

    asked: dict[str, Path] = field(default_factory=dict)
    written: dict[str, Path] = field(default_factory=dict)

    def told(self) -> str:
        """What is written and what is not, for the message of a command that did not come to its end."""
        missing = [path for target, path in self.asked.items() if target not in self.written]
        if not self.written:
            return "nothing was written"
        written = f"written: {_listed(self.written.values())}"
        return f"{written}; not written: {_listed(missing)}" if missing else written


def _listed(paths: Iterable[Path]) -> str:
    return ", ".join(printable(str(path)) for path in paths)


_asked: ContextVar[Asked | None] = ContextVar("_asked", default=None)


@contextmanager
def files_told() -> Iterator[Asked]:
    """Which files the block is asked for by `check_outs`, and which it writes."""
    found = Asked()
    token = _asked.set(found)
    try:
        yield found
    finally:
        _asked.reset(token)


def note_asked(path: Path) -> None:
    """Count a file as asked for, where `files_told` asks."""
    found = _asked.get()
    if found is not None:
        found.asked[os.path.realpath(path)] = path


def note_written(path: Path) -> None:
    """Count a file as written, where `files_told` asks."""
    found = _asked.get()
    if found is not None:
        found.written[os.path.realpath(path)] = path


def check_outs(outs: Mapping[str, Path | None], inputs: Iterable[str | Path] = ()) -> None:
    """DataError, before anything is computed, where a file cannot be written, is one that is read, or named twice.

    outs: option -> its file, None where it is not asked for; inputs: the files that are read
    """
    read = {os.path.realpath(source): source for source in inputs}
    taken: dict[str, str] = {}
    for option, path in outs.items():
        if path is None:
            continue
        target = str(check_writable(path))
        if target in read:
            raise DataError(
                f"{option} {path} is the file that {read[target]} is read from; choose another"
            )
        if target in taken:
            raise DataError(f"{taken[target]} and {option} name one file, {path}; choose two")
        taken[target] = option
        note_asked(path)


def csv_cells(values: Iterable[Any]) -> list[Any]:
    """Values as a row of CSV: an apostrophe before every sign at which a spreadsheet would begin a formula.

    Numbers stay as they are, and all other text. What begins with apostrophes and such a sign gets one more, so
    that taking one away restores every text.
    """
    return [_as_text(value) if isinstance(value, str) else value for value in values]


def csv_comment(text: str) -> str:
    """A comment line of CSV, which a spreadsheet takes for cells all the same."""
    return "# " + _FORMULA_IN_COMMENT.sub("'", text)


def _as_text(text: str) -> str:
    return text if _NUMBER.fullmatch(text) else _FORMULA.sub("'", text)


def write_whole(path: Path, contents: bytes) -> None:
    """Write a file at once: killed in the middle, the old one is whole."""
    target = check_writable(path)
    try:
        with _temporary_file(target.parent) as file:
            file.write(contents)
            file.flush()
            os.fsync(file.fileno())
            temporary = Path(file.name)
            temporary.chmod(_mode_of(target))
            if fcntl is None:
                file.close()
            try:
                temporary.replace(target)
            finally:
                # An interrupt may come after the file has its name.
                if not temporary.exists():
                    note_written(path)
    except OSError as error:
        raise DataError(
            f"{path}: cannot be written ({error.strerror}); choose another place"
        ) from None


@contextmanager
def _temporary_file(folder: Path) -> Iterator[IO[bytes]]:
    """A new file that goes again where it is not renamed."""
    clear_leftovers(folder)
    while True:
        with tempfile.NamedTemporaryFile(dir=folder, prefix=_PREFIX, delete=False) as file:
            try:
                if not _is_held(file.fileno(), file.name):
                    continue
                yield file
            finally:
                Path(file.name).unlink(missing_ok=True)
            return


@contextmanager
def temporary_folder() -> Iterator[Path]:
    """A new folder among the system's temporary ones, gone in the end."""
    clear_leftovers(Path(tempfile.gettempdir()))
    while True:
        with tempfile.TemporaryDirectory(prefix=_PREFIX, ignore_cleanup_errors=True) as name:
            descriptor = os.open(name, os.O_RDONLY)
            try:
                if not _is_held(descriptor, name):
                    continue
                yield Path(name)
            finally:
                os.close(descriptor)
            return


def _is_held(descriptor: int, name: str) -> bool:
    """Whether a new file is this process' until it is closed: not where somebody is clearing it away."""
    try:
        if fcntl is not None:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:
        pass  # a file system without locks, where nothing is cleared away either
    return os.path.exists(name)


def clear_leftovers(folder: Path) -> None:
    """Remove what runs that were killed have left of their temporary files in a folder: those that nobody holds."""
    with suppress(OSError):
        for entry in list(os.scandir(folder)):
            if fcntl is not None and _TEMPORARY.fullmatch(entry.name):
                with suppress(OSError):
                    _clear(Path(entry.path))


def _clear(path: Path) -> None:
    descriptor = os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK)
    try:
        found = os.fstat(descriptor)
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        if found.st_uid != os.geteuid():
            return
        if stat.S_ISDIR(found.st_mode):
            shutil.rmtree(path)
        elif stat.S_ISREG(found.st_mode):
            path.unlink()
    finally:
        os.close(descriptor)


def _mode_of(target: Path) -> int:
    if target.exists():
        return stat.S_IMODE(target.stat().st_mode)
    umask = os.umask(0)
    os.umask(umask)
    return 0o666 & ~umask
