"""Types: mypy is strict on every room; what it still finds in some modules may only become less."""

import os
import re
import subprocess
import sys
import tempfile
import zlib
from pathlib import Path

ROOT = Path(__file__).parents[1]
# Rooms with faults left, and how many mypy finds in each today: lower or strike a number, never raise it.
OPEN = {"measured": 208, "pages": 53, "forward": 12}


def faults() -> dict[str, list[str]]:
    """What mypy finds, by room; its cache is kept from run to run among other temporary files."""
    cache = f"hevopt-mypy-{os.getuid()}-{zlib.crc32(bytes(ROOT)):08x}"
    command = [
        sys.executable, "-m", "mypy", "hevopt", "--no-pretty", "--no-color-output", "--no-error-summary",
        "--hide-error-context", "--cache-dir", str(Path(tempfile.gettempdir()) / cache),
    ]  # fmt: skip
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    assert done.returncode in (0, 1), done.stdout + done.stderr
    found: dict[str, list[str]] = {}
    for line in done.stdout.splitlines():
        if place := re.match(r"hevopt/(\w+)(?:/\S+)?(?:\.py)?:\d+: error: ", line):
            found.setdefault(place[1], []).append(line)
    return found


def test_types_hold_and_what_is_open_only_shrinks():
    found = faults()
    more = [room for room, lines in found.items() if len(lines) > OPEN.get(room, 0)]
    assert not more, "\n".join(line for room in more for line in found[room])
    fewer = {
        room: len(found.get(room, [])) for room in OPEN if len(found.get(room, [])) < OPEN[room]
    }
    assert not fewer, f"better than OPEN says, which becomes: {fewer}"


def test_users_of_the_package_get_its_types():
    assert (ROOT / "hevopt" / "py.typed").is_file()
