"""The fuzzer: spoils good files in many ways and checks that hevopt answers each with a result or one message.

    python tests/fuzzing/run.py --count 10000 --seed 1

Case n of a seed is always the same. Faults are told as they
are found; exit status 1 and the spoilt files in --keep where there was one.

What it has found, all mended since:
- scipy's loadmat dies of a segmentation fault on spoilt .mat files; hence a reader of levels 4 and 5 of our own.
- A TOML key of 100 000 dotted parts takes 22 GB in tomllib; such keys are refused before.
- A KeyError in `validate`; two RuntimeWarnings on maps that are zero all over.
- Spoilt stores of sweeps that SQLite reads well ended `report` and `sweep --status` in a JSONDecodeError.
- Of a store whose schema is spoilt, SQLite's message quotes control characters.
- `cycles import` quoted the whole of a log of signals whose header ran into its rows, control characters included.
- Stores and saved comparisons, changed value by value: KeyError, ZeroDivisionError, OverflowError, AttributeError,
  UnicodeEncodeError and ValueError of `report` and `sweep`; a view without an end; lists of 11 GB.
- `coastdown` named every column of a file with thousands, in a message of 22 000 characters.
- NOx of one speed alone divided by zero on the way to its message; units in a log of signals reached the terminal
  with their control characters.
"""

import argparse
import random
import shutil
import sys
import tempfile
from collections import Counter
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from importlib import import_module
from pathlib import Path
from pkgutil import walk_packages

if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).parents[1]))

from fuzzing.corpus import seeds
from fuzzing.crafted import CRAFTED
from fuzzing.mutations import COMMON, RARE, RARE_EVERY
from fuzzing.runner import fault_of, run
from fuzzing.seed import SHORT_CYCLE, Seed

TELL_EVERY = 250


def spoilt(
    seed: int, case: int, files: list[Seed], *, rare: bool
) -> tuple[Seed, bytes, list[str], str]:
    """Case n: the good file, its spoilt contents, the command, and what was done to it."""
    rng = random.Random(f"{seed}/{case}")
    good = rng.choice(files)
    own = CRAFTED.get(good.name)
    if own is not None and rng.random() < 0.7:
        mutation = rng.choice(own)
        words = list(rng.choice(good.commands))
        return good, mutation(good.contents, rng), words, mutation.__name__
    kinds = (
        RARE if rare and case % RARE_EVERY == 0 else rng.choices(COMMON, k=rng.choice((1, 1, 2, 3)))
    )
    contents = good.contents
    for mutation in kinds:
        contents = mutation(contents, rng)
    return good, contents, list(rng.choice(good.commands)), "+".join(m.__name__ for m in kinds)


def fuzz(
    seed: int, cases: range, keep: Path | None, *, rare: bool, tell: Callable[[str], object] = len
) -> tuple[list[str], Counter]:
    """Descriptions of all cases with a fault, and how often each status came; tell: hears of each fault at once."""
    _load_all()
    files, faults, statuses = seeds(), [], Counter()
    for case in cases:
        if case > cases.start and not case % TELL_EVERY:
            tell(f"{len(faults)} faults in {case - cases.start} cases so far")
        good, contents, words, how = spoilt(seed, case, files, rare=rare)
        with tempfile.TemporaryDirectory(prefix="hevopt-fuzz-") as name:
            folder = Path(name)
            for other, whole in {**good.beside, good.name: contents}.items():
                (folder / other).write_bytes(whole)
            seen = run(words, folder)
            statuses[f"{words[0]} {seen.status}"] += 1
            fault = fault_of(seen)
            if fault:
                last = (seen.err.strip().splitlines() or [""])[-1][:300]
                faults.append(f"case {case}: {' '.join(words)}; {how}: {fault}; {last}")
                tell(faults[-1])
                if keep:
                    keep.mkdir(parents=True, exist_ok=True)
                    shutil.copy(folder / good.name, keep / f"{case}-{good.name}")
    return faults, statuses


def _load_all() -> None:
    """So that the children, which share this process's memory, need not: loading takes two thirds of a case."""
    import hevopt

    for name in ("matplotlib.pyplot", "openpyxl", "scipy.optimize", "scipy.interpolate"):
        import_module(name)
    for module in walk_packages(hevopt.__path__, "hevopt."):
        with suppress(ImportError):  # of an extra that is not installed
            import_module(module.name)
    from hevopt import compare

    compare(SHORT_CYCLE, ["A", "C2"], ["conventional", "ecms"], allow_shortfall=True)


def main() -> None:
    parser = argparse.ArgumentParser(description="spoils files and checks what hevopt says")
    parser.add_argument("--count", type=int, default=10_000)
    parser.add_argument(
        "--first", type=int, default=0, help="first case, to go on or to repeat one"
    )
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--keep", type=Path, help="folder for the files of faulty cases")
    chosen = parser.parse_args()
    cases = range(chosen.first, chosen.first + chosen.count)
    tell = partial(print, flush=True)
    faults, statuses = fuzz(chosen.seed, cases, chosen.keep, rare=True, tell=tell)
    for name, count in sorted(statuses.items()):
        print(f"{count:6} {name}")
    print(f"{len(faults)} faults in {chosen.count} cases", *faults, sep="\n")
    sys.exit(bool(faults))


if __name__ == "__main__":
    main()
