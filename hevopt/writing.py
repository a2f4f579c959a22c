"""Writing a file at once, so that a reader, or a run killed in the middle, never leaves half of one."""

import os
import re
import shutil
import stat
import tempfile
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO

from hevopt.errors import DataError

try:
    import fcntl
except ImportError:  # not on every system
    fcntl = None

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
            temporary.replace(target)
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
