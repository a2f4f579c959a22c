"""Runs a command on a spoilt file in a process of its own, and judges what a user would see."""

import io
import os
import resource
import signal
import sys
import tempfile
import time
from collections.abc import Sequence
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import dataclass
from pathlib import Path

# Of processor time, so that a loaded machine raises no alarm; of wall time, for what waits for ever.
SECONDS_MAX, WALL_SECONDS_MAX = 10.0, 300.0
BYTES_MAX = 2_000_000_000
_ADDRESS_SPACE = 8_000_000_000
_MESSAGE_MAX = 20_000
# 0 a valid result, 2 one clear message, 3 a valid file whose problem has no solution.
_STATUSES = (0, 2, 3)


@dataclass(frozen=True)
class Seen:
    """What a command did: status (negative: killed by a signal), what it printed, processor time, highest memory
    beyond that of the process it was forked from, wall time."""

    status: int
    out: str
    err: str
    seconds: float
    memory_bytes: int
    wall_seconds: float = 0.0


def fault_of(seen: Seen) -> str | None:
    """What is wrong with what a user saw; None where nothing is."""
    if seen.seconds > SECONDS_MAX:
        return f"took {seen.seconds:.1f} s"
    if seen.wall_seconds > WALL_SECONDS_MAX:
        return f"did not end within {WALL_SECONDS_MAX:.0f} s"
    if seen.memory_bytes > BYTES_MAX:
        return f"took {seen.memory_bytes / 1e9:.2f} GB"
    if seen.status not in _STATUSES:
        return f"status {seen.status}"
    if "Traceback" in seen.err + seen.out:
        return "a traceback"
    # validate lists the faults of all files on standard output: there they are the result.
    if seen.status and not (seen.err.startswith(("hevopt: ", "Usage: ")) or seen.out.strip()):
        return f"status {seen.status} without a message"
    if seen.status == 2 and seen.err.count("hevopt: error: ") > 1:
        return "more than one message"
    if len(seen.err) > _MESSAGE_MAX:
        return f"a message of {len(seen.err)} characters"
    if any(not c.isprintable() and c not in "\n\t" for c in seen.err + seen.out):
        return "control characters of the file reach the terminal"
    return None


def run(words: Sequence[str], folder: Path) -> Seen:
    """`hevopt` with these words in a folder, in a child that shares what is already loaded here."""
    with tempfile.TemporaryFile() as out, tempfile.TemporaryFile() as err:
        began = time.monotonic()
        sys.stdout.flush()
        sys.stderr.flush()
        shared = int(Path("/proc/self/statm").read_text().split()[1]) * resource.getpagesize()
        child = os.fork()
        if child == 0:
            _child(words, folder, out.fileno(), err.fileno())
        pid, wait_status, usage = 0, 0, None
        while pid == 0 and time.monotonic() - began < WALL_SECONDS_MAX + 1:
            pid, wait_status, usage = os.wait4(child, os.WNOHANG)
            time.sleep(0.002)
        if pid == 0:
            os.kill(child, signal.SIGKILL)
            pid, wait_status, usage = os.wait4(child, 0)
        wall_seconds = time.monotonic() - began
        out.seek(0)
        err.seek(0)
        return Seen(
            os.waitstatus_to_exitcode(wait_status),
            out.read().decode(errors="replace"),
            err.read().decode(errors="replace"),
            usage.ru_utime + usage.ru_stime,
            max(0, usage.ru_maxrss * 1024 - shared),
            wall_seconds,
        )


def _child(words: Sequence[str], folder: Path, out: int, err: int) -> None:
    from hevopt.cli import main

    status = 70
    try:
        os.chdir(folder)
        os.dup2(out, 1)
        os.dup2(err, 2)
        resource.setrlimit(resource.RLIMIT_AS, (_ADDRESS_SPACE, _ADDRESS_SPACE))
        resource.setrlimit(resource.RLIMIT_CPU, (int(SECONDS_MAX) + 1, int(SECONDS_MAX) + 1))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        sys.argv = ["hevopt", *words]
        with (
            redirect_stdout(io.TextIOWrapper(io.FileIO(1, "w", closefd=False), write_through=True)),
            redirect_stderr(io.TextIOWrapper(io.FileIO(2, "w", closefd=False), write_through=True)),
        ):
            try:
                main()
            except SystemExit as stop:
                status = stop.code or 0
            except BaseException:
                import traceback

                traceback.print_exc()
    finally:
        os._exit(status)
