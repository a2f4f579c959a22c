"""Which tests take long enough to have a tier of their own: python tests/slow.py LOG [LOG ...]

Reads what `pytest -m "not long" --durations=0 --durations-min=0.1 > LOG` printed and writes to tests/slow.txt the
functions that took more than two seconds together, and the files in which setting up took as much, as whoever of
them comes first would pay for it. The default command leaves them out; `pytest -m slow` runs them, and so does
`.ci/run`.
"""

import re
import sys
from collections import defaultdict
from pathlib import Path

LISTED = Path(__file__).with_name("slow.txt")
_SECONDS = 2.0
# What the one test command holds, whatever it takes.
_ALWAYS = (
    "test_types.py",
    "test_structure.py",
    "test_readme.py",
    "test_docs.py::test_the_site_builds",
)
_LINE = re.compile(r"([\d.]+)s (call|setup|teardown) +tests/(\S+?)(::\w+)")


def slow() -> frozenset[str]:
    """What is in the slow tier: files below tests/, and functions as FILE::FUNCTION."""
    return frozenset(LISTED.read_text().split())


def measured(log: str) -> list[str]:
    """What a log of durations says is slow, in order of names."""
    seconds: dict[str, float] = defaultdict(float)
    for line in log.splitlines():
        if found := _LINE.match(line):
            taken, phase, path, function = found.groups()
            seconds[path if phase == "setup" else path + function] += float(taken)
    dear = {name for name, taken in seconds.items() if taken > _SECONDS}
    return sorted(
        name
        for name in dear
        if not name.startswith(_ALWAYS) and (name.split("::")[0] not in dear or "::" not in name)
    )


if __name__ == "__main__":
    logs = "".join(Path(log).read_text() for log in sys.argv[1:])
    LISTED.write_text("\n".join(measured(logs)) + "\n")
