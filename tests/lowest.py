"""Every declared minimum version at once: installs the floors of pyproject.toml and drives hevopt with them.

python tests/lowest.py [--python PYTHON] [--keep FOLDER]

A fresh virtual environment gets the lowest version of every dependency that pyproject.toml declares, extras and
build included, and hevopt from a wheel built there. In an empty folder every command must end as it should, and
the tests of readers, solvers, bounds and backends must pass. Status 1 where one does not.
"""

import argparse
import os
import re
import subprocess
import sys
import tempfile
import time
import tomllib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]

_FLOOR = re.compile(r"([\w.-]+)(\[[\w.,-]+\])?>=([\w.]+)(\s*;.*)?")

# Away at once to 50 km/h, and back to standstill.
_CYCLE = "time_s,speed_kmh\n" + "".join(
    f"{second},{max(0, min(4 * second - 20, 50, 260 - 4 * second))}\n" for second in range(71)
)
_STUDY = """architecture = "C2"
cycles = ["short.csv"]
strategies = ["ecms"]

[parameters]
gearbox.final_drive_ratio = [3.0, 3.4]
"""

# Words after `hevopt`, one command a line, behind the status it must end with.
_COMMANDS = """
0 --help
0 compare --architectures A --strategies baseline
2 compare --no-such-option
2 compare --cycle no_such_cycle
0 compare --cycle short.csv --architectures A,C2 --strategies all --out rows.parquet --save all.json.gz
0 report all.json.gz --out page.html
0 compare --cycle short.csv --architectures A,C2 --json
0 pareto C2 --cycle short.csv --points 3
0 sensitivity C2 --cycle short.csv
0 table C2 --cycle short.csv --out table.npz
0 architectures new mine --like C2
0 validate mine.toml short.csv
0 sweep study.toml --store loky.sqlite --jobs 2
0 sweep study.toml --store dask.sqlite --jobs 2 --backend dask
0 sweep study.toml --store ray.sqlite --jobs 2 --backend ray
0 sweep --store loky.sqlite --export cases.parquet
0 report loky.sqlite --out sweep.html
"""

TESTS = [
    "tests/measured",
    "tests/strategies",
    "tests/bounds",
    "tests/car_files",
    "tests/checks",
    "tests/output",
    "tests/files",
    "tests/problem",
    "tests/gym",
    "tests/sweeps/store",
    "tests/pages/test_browser.py",
    "tests/sweeps/workers/test_backends.py",
]


def requirements(project: Mapping[str, Any]) -> Iterator[str]:
    """Every requirement of a pyproject.toml, of the build and of extras too."""
    yield from project["build-system"]["requires"]
    yield from project["project"]["dependencies"]
    for extra in project["project"].get("optional-dependencies", {}).values():
        yield from extra


def lowest(project: Mapping[str, Any]) -> list[str]:
    """Each requirement held to its floor; an extra that names the project itself adds nothing."""
    pins = []
    for requirement in requirements(project):
        parts = _FLOOR.fullmatch(requirement.strip())
        if parts is not None:
            name, extras, version, marker = (part or "" for part in parts.groups())
            pins.append(f"{name}{extras}=={version}{marker}")
        elif not re.match(rf"{re.escape(project['project']['name'])}\b", requirement):
            raise ValueError(f"{requirement!r} has no floor of the form NAME>=VERSION")
    return list(dict.fromkeys(pins))


def _install(python: str, folder: Path) -> Path:
    """The commands' folder of an environment with the lowest versions, and hevopt from its wheel."""
    subprocess.run([python, "-m", "venv", folder / "venv"], check=True)
    scripts = folder / "venv" / "bin"
    pins = folder / "lowest.txt"
    pins.write_text("\n".join(lowest(tomllib.loads((ROOT / "pyproject.toml").read_text()))) + "\n")
    pip = [scripts / "python", "-m", "pip", "--disable-pip-version-check"]
    subprocess.run([*pip, "install", "-q", "-r", pins], check=True)
    build = ["wheel", "-q", "--no-deps", "--no-build-isolation", "-w", folder / "wheel", ROOT]
    subprocess.run([*pip, *build], check=True)
    wheels = (folder / "wheel").glob("*.whl")
    subprocess.run([*pip, "install", "-q", "--no-deps", "--force-reinstall", *wheels], check=True)
    subprocess.run([*pip, "check"], check=True)
    return scripts


def _drive(scripts: Path, folder: Path) -> list[str]:
    """The commands that ended otherwise than they should, each with what it said."""
    (folder / "short.csv").write_text(_CYCLE)
    (folder / "study.toml").write_text(_STUDY)
    faults = []
    for line in _COMMANDS.strip().splitlines():
        due, words = line.split(maxsplit=1)
        started = time.monotonic()
        done = subprocess.run(
            [scripts / "hevopt", *words.split()],
            cwd=folder,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            timeout=900,
        )
        said = f"hevopt {words}: status {done.returncode}"
        print(f"{time.monotonic() - started:6.1f} s  {said}", flush=True)
        if done.returncode != int(due) or "Traceback" in done.stdout:
            faults.append(f"{said}, not {due}\n{done.stdout}")
    return faults


def _test(scripts: Path) -> list[str]:
    """What pytest's run says of itself; warnings do not count, as old releases use what newer ones deprecate."""
    words = [scripts / "pytest", "-W", "ignore", *TESTS]
    status = subprocess.run(words, cwd=ROOT).returncode
    return [f"pytest: status {status}"] if status else []


def _main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--python", default=sys.executable, help="interpreter to install for")
    parser.add_argument("--keep", type=Path, help="folder of the environment, kept and used again")
    asked = parser.parse_args()
    for name in ("PYTHONPATH", "PYTHONHOME"):
        os.environ.pop(name, None)
    with tempfile.TemporaryDirectory() as temporary:
        folder = (asked.keep or Path(temporary)).resolve()
        folder.mkdir(parents=True, exist_ok=True)
        scripts = _install(asked.python, folder)
        print((folder / "lowest.txt").read_text(), flush=True)
        work = folder / "empty"
        work.mkdir(exist_ok=True)
        faults = _drive(scripts, work) + _test(scripts)
    print("\n".join(faults) or "every command and test works with the lowest versions")
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(_main())
