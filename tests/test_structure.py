"""The shape of the house: imports go down only, public names are exact, data files name their sources."""

import ast
import re
import subprocess
import sys
from pathlib import Path

import pytest

import hevopt

PACKAGE = Path(hevopt.__file__).parent
ROOT = Path(__file__).parents[1]

# From the bottom up; a module may import from its own row or rows above it in this list, never below.
LAYERS = [
    ["errors", "units", "_compile", "grid", "key_meanings"],
    ["files", "frozen"],
    ["writing"],
    ["datafile", "cycle", "keypaths"],
    ["_battery_kernels", "file_fields", "flows"],
    ["vehicle", "engine", "machine", "battery", "transmission"],
    [
        "architecture_file",
        "car_file",
        "engine_file",
        "gearbox_file",
        "machine_file",
        "battery_file",
    ],
    ["imports"],
    ["scaling", "file_schema"],
    ["components"],
    ["architecture", "problem"],
    ["demand", "_choices_kernels", "_prices_kernels", "_step_prices_kernels"],
    ["driver", "choices"],
    ["couplings", "prices", "simulation", "_lower_dp_kernels"],
    ["balance", "step_prices", "shortfall"],
    ["rejects", "lower_dp", "power_flows"],
    ["powertrain", "provenance"],
    ["strategies"],
    ["certificate"],
    ["case", "pareto", "status"],
    ["rows"],
    ["study"],
    ["study_file", "outputs"],
    ["published", "sensitivity"],
    ["reproduction"],
    ["report"],
    ["architecture_new", "sweeps"],
    ["file_checks"],
    ["study_checks"],
    ["validation"],
    ["pages"],
    ["commands"],
    ["cli"],
]
STRATEGIES_MAY_SEE = {
    "errors", "problem", "simulation", "choices", "prices", "_prices_kernels", "battery",
    "_battery_kernels", "_compile", "strategies",
}  # fmt: skip


def imports_of(path: Path) -> set[str]:
    """First part below `hevopt` of every project import in a file."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if (
            isinstance(node, ast.ImportFrom)
            and node.module
            and node.module.split(".")[0] == "hevopt"
        ):
            parts = node.module.split(".")
            found |= {parts[1]} if len(parts) > 1 else {alias.name for alias in node.names}
        elif isinstance(node, ast.Import):
            names = [a.name.split(".") for a in node.names]
            found |= {n[1] for n in names if n[0] == "hevopt" and len(n) > 1}
    return found - {"__version__"}


def layer_of(name: str) -> int:
    return next(i for i, row in enumerate(LAYERS) if name in row)


def place_of(path: Path) -> str:
    """A module's name, or that of the folder it lies in."""
    return path.relative_to(PACKAGE).parts[0].removesuffix(".py")


@pytest.mark.parametrize(
    "path", sorted(PACKAGE.glob("**/*.py")), ids=lambda p: str(p.relative_to(PACKAGE))
)
def test_modules_import_downwards_only(path):
    place = place_of(path)
    if place == "__init__":
        return
    for name in imports_of(path) - {place}:
        assert layer_of(name) < layer_of(place), f"{path.stem} imports {name}"


@pytest.mark.parametrize(
    "path", sorted((PACKAGE / "strategies").glob("*.py")), ids=lambda p: p.stem
)
def test_strategies_see_the_problem_and_never_a_car(path):
    assert imports_of(path) <= STRATEGIES_MAY_SEE


def test_public_names_are_exact_and_load():
    assert len(set(hevopt.__all__)) == len(hevopt.__all__)
    for name in hevopt.__all__:
        value = getattr(hevopt, name)
        assert not isinstance(value, type(hevopt)), f"{name} is a module"


@pytest.mark.parametrize(
    "path",
    sorted([*ROOT.glob("architectures/**/*.toml"), *ROOT.glob("cycles/*.csv")]),
    ids=lambda p: p.name,
)
def test_data_files_name_source_and_licence(path):
    comments = " ".join(line for line in path.read_text().splitlines() if "#" in line)
    assert "icence" in comments or "MIT" in comments
    assert re.search(r"\[[SFE]\]|Source|Millo", comments)


@pytest.mark.parametrize("words", ["check", "format --check"])
def test_code_is_formatted_and_free_of_lint(words):
    command = [sys.executable, "-m", "ruff", *words.split(), "--no-cache", "hevopt", "tests"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout


def test_importing_hevopt_loads_no_compiled_part():
    code = "import sys, hevopt; sys.exit(any(m.startswith('numba') for m in sys.modules))"
    assert subprocess.run([sys.executable, "-c", code]).returncode == 0
