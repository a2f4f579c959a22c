"""Writing a file at once, so that a reader, or a run killed in the middle, never leaves half of one."""

import os
import stat
import tempfile
from collections.abc import Iterable, Mapping
from pathlib import Path

from hevopt.errors import DataError


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
    target, temporary = check_writable(path), None
    try:
        with tempfile.NamedTemporaryFile(dir=target.parent, prefix=".hevopt.", delete=False) as f:
            temporary = Path(f.name)
            f.write(contents)
            f.flush()
            os.fsync(f.fileno())
        temporary.chmod(_mode_of(target))
        temporary.replace(target)
    except OSError as error:
        raise DataError(
            f"{path}: cannot be written ({error.strerror}); choose another place"
        ) from None
    finally:
        if temporary is not None:
            temporary.unlink(missing_ok=True)


def _mode_of(target: Path) -> int:
    if target.exists():
        return stat.S_IMODE(target.stat().st_mode)
    umask = os.umask(0)
    os.umask(umask)
    return 0o666 & ~umask
