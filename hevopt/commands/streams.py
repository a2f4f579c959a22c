"""Standard streams that last: closed, or given up by their reader, they take what comes and the work goes on."""

import io
import os
import sys
from typing import Any


class _Lasting(io.FileIO):
    """The descriptor of a stream. Nobody reading is no fault; another one, such as a full disk, is raised once.

    On stderr there is nobody to tell of one.
    """

    def __init__(self, descriptor: int) -> None:
        super().__init__(descriptor, "w", closefd=False)
        self._lost = False

    def write(self, data: Any, /) -> int:
        if not self._lost:
            try:
                return super().write(data)
            except OSError as error:
                self._lost = True
                if self.fileno() == 1 and not isinstance(error, BrokenPipeError):
                    raise OSError(error.errno, error.strerror, "standard output") from None
        return memoryview(data).nbytes


def keep_streams() -> None:
    """Make the standard streams such; those that a program has put in their place stay."""
    for descriptor in range(3):
        try:
            os.fstat(descriptor)
        except OSError:
            # Or the next file that is opened would be taken for the stream.
            os.open(os.devnull, os.O_RDWR)
    # A terminal that lacks a letter of the report, such as Δ, shows "?" in its place.
    sys.stdout = _lasting(1, sys.stdout, sys.__stdout__, "replace")
    sys.stderr = _lasting(2, sys.stderr, sys.__stderr__, "backslashreplace")


def _lasting(descriptor: int, stream: Any, first: Any, errors: str) -> Any:
    if stream is not first:
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors=errors)
        return stream
    raw = _Lasting(descriptor)
    encoding = "utf-8" if stream is None else stream.encoding
    return io.TextIOWrapper(io.BufferedWriter(raw), encoding, errors, line_buffering=True)
