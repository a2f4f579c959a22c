"""Which tests take long enough to have a tier of their own: python tests/slow.py LOG

Reads what `pytest -m "not long" --durations=0 --durations-min=0.1 > LOG` printed and writes to tests/slow.txt the
functions that took more than two seconds together, with what is set up for them. The default command leaves them
out; `pytest -m slow` runs them, and so does `.ci/run`.
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
_LINE = re.compile(r"([\d.]+)s (?:call|setup|teardown) +tests/(\S+?::\w+)")


def slow() -> frozenset[str]:
    """Functions of the slow tier, as FILE::FUNCTION below tests/."""
    return frozenset(LISTED.read_text().split())


def measured(log: str) -> list[str]:
    """What a log of durations says is slow, in order of names."""
    seconds: dict[str, float] = defaultdict(float)
    for line in log.splitlines():
        if found := _LINE.match(line):
            seconds[found[2]] += float(found[1])
    return sorted(
        name for name, taken in seconds.items() if taken > _SECONDS and not name.startswith(_ALWAYS)
    )


if __name__ == "__main__":
    LISTED.write_text("\n".join(measured(Path(sys.argv[1]).read_text())) + "\n")
