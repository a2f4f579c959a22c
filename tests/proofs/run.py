"""The attack on the proofs: random problems of the kinds that break them, each against trying every plan.

Bounds on what lies between levels are tried on a finer problem of the same number, see split.py. Proof files are
derived again by the checker, which shares no code with hevopt, and refused where their claim is raised: again.py.

    python tests/proofs/run.py --count 10000
    python tests/proofs/run.py --count 10000 --parts checker

Problem n is always the same. Exit status 1 and one line per fault where something was wrong.
"""

import argparse
import sys
import warnings
from collections.abc import Collection
from pathlib import Path

if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).parents[1]))

from proofs.again import again_faults
from proofs.check import faults_of
from proofs.draw import draw
from proofs.split import split_faults

from hevopt.errors import CoarseTableWarning

# Strategies that take long are tried on every so many problems.
_RARE_EVERY = 50
PARTS = "plans", "split", "checker"


def attack(
    problems: range, nodes: int = 1001, parts: Collection[str] = ("plans", "split")
) -> list[str]:
    """The faults of a range of problems, each with its number; nodes: see `faults_of`; parts: of PARTS."""
    faults = []
    for n in problems:
        found = []
        try:
            if "plans" in parts:
                found += faults_of(draw(n), every_strategy=n % _RARE_EVERY == 0, nodes=nodes)
            found += split_faults(n) if "split" in parts else []
            found += again_faults(n) if "checker" in parts else []
        except Exception as error:
            found.append(f"{type(error).__name__}: {error}")
        faults += [f"problem {n}: {fault}" for fault in found]
    return faults


def main() -> int:
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--count", type=int, default=10_000, help="how many problems")
    options.add_argument("--first", type=int, default=0, help="number of the first")
    options.add_argument("--nodes", type=int, default=1001, help="of dp and of the last rungs")
    options.add_argument("--parts", nargs="+", choices=PARTS, default=PARTS, help="what to try")
    given = options.parse_args()
    warnings.simplefilter("ignore", CoarseTableWarning)  # coarse tables are what is tried
    faults = 0
    for n in range(given.first, given.first + given.count):
        for fault in attack(range(n, n + 1), given.nodes, given.parts):
            faults += 1
            print(fault, flush=True)
        if (n + 1) % 500 == 0:
            print(f"{n + 1 - given.first} done", file=sys.stderr, flush=True)
    print(f"{given.count} problems, {faults} faults")
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
