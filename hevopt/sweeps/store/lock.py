"""One sweep at a time on a store: a lock on a file beside it, which the system lifts when its holder ends."""

import fcntl
import os
import socket
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from hevopt.errors import DataError
from hevopt.files.shown import printable

# A lock that another sweep removes meanwhile is taken anew; each time means a file system without lasting files.
_TRIES_MAX = 1000
_OWNER_BYTES = 200


@contextmanager
def locked(store: Path) -> Iterator[None]:
    """Hold a store for this process, by whatever link; DataError, naming the holder, where another one does."""
    target = Path(os.path.realpath(store))
    # SQLite keeps what is not yet in the file beside one of its names: who comes by the other spoils it.
    if target.exists() and target.stat().st_nlink > 1:
        raise DataError(
            f"{store}: has other names (hard links), by which a second sweep could spoil it; name a copy, with "
            "--store"
        )
    path = target.with_name(target.name + ".lock")
    descriptor = _acquired(path, store)
    try:
        os.ftruncate(descriptor, 0)
        os.pwrite(descriptor, f"process {os.getpid()} on {socket.gethostname()}".encode(), 0)
    except OSError:
        pass  # a full disk: the lock holds all the same, only without a name
    try:
        yield
    finally:
        # Removed while still held; who opened it before finds out, see `_is_file_at`.
        with suppress(OSError):
            path.unlink()
        os.close(descriptor)


def _acquired(path: Path, store: Path) -> int:
    for _ in range(_TRIES_MAX):
        try:
            descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o666)
        except OSError as error:
            raise DataError(
                f"{store}: a sweep cannot lock it ({error.strerror}); name a store in a folder that can be "
                "written, with --store"
            ) from None
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            owner = printable(os.pread(descriptor, _OWNER_BYTES, 0).decode(errors="replace"))
            os.close(descriptor)
            if isinstance(error, BlockingIOError):
                raise DataError(
                    f"{store}: another sweep is running on it ({owner or 'no name given'}); wait for it, stop "
                    "it, or name another store with --store"
                ) from None
            raise DataError(
                f"{store}: its file system has no locks ({error.strerror}); name a store on a local disk, "
                "with --store"
            ) from None
        if _is_file_at(descriptor, path):
            return descriptor
        os.close(descriptor)
    raise DataError(
        f"{store}: its lock is gone each time it is taken; name a store on a local disk, with --store"
    )


def _is_file_at(descriptor: int, path: Path) -> bool:
    """Whether a descriptor is of the file that now has the name: not of one removed since it was opened."""
    try:
        return os.path.samestat(os.fstat(descriptor), path.stat())
    except FileNotFoundError:
        return False
