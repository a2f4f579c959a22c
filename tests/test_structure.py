"""The shape of the house: imports go down only, public names are exact, data files name their sources."""

import ast
import re
import subprocess
import sys
from collections import defaultdict
from fnmatch import fnmatch
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

import hevopt
from hevopt._compile import _COMPILED_WITH

PACKAGE = Path(hevopt.__file__).parent
ROOT = Path(__file__).parents[1]

# Floors of the house from the bottom up; a room sees those below its own floor, and itself.
FLOORS = [
    ["errors", "units", "_compile"],
    ["display"],
    ["files", "problem"],
    ["car", "bounds"],
    ["mean_value"],
    ["driving", "car_files", "strategies"],
    ["powertrain", "measured", "gym"],
    ["forward"],
    ["studies", "tipin", "fmu"],
    ["reproduction", "sweeps"],
    ["sizing"],
    ["output", "checks"],
    ["pages"],
    ["commands"],
    ["cli"],
]
# What sees the waist and never a car, a cycle or a file.
BLIND = {
    "problem": {"errors", "display", "_compile"},
    "bounds": {"errors", "display", "_compile", "problem"},
    "strategies": {"errors", "display", "_compile", "problem", "bounds"},
    "gym": {"errors", "problem", "bounds", "strategies"},
}
# Functions above 50 lines, each with its reason.
LONG = {
    "forward._plant_kernels.step": "one implicit step, compiled as a whole",
    "forward._slip_kernels.slip_step": "one implicit step, compiled as a whole",
    "forward._drive_kernels.after_step": "one step, compiled as a whole",
    "forward._pull_kernels.after_pull": "one step, compiled as a whole",
    "commands.driving.drive": "a list of options",
    "commands.driving.performance": "a list of options",
    "commands.importing.import_cycle": "a list of options",
    "commands.mapping.import_map": "a list of options",
    "commands.coasting.coastdown": "a list of options",
    "commands.solving.compare": "a list of options",
    "commands.solving.run": "a list of options",
    "commands.studies.pareto": "a list of options",
    "commands.sweep.sweep": "a list of options",
    "commands.turbo.tipin": "a list of options",
    "bounds._lower_dp_kernels.lower_backward": "one recursion, compiled as a whole",
    "bounds.step_prices._lp_part": "one linear program, set up as its docstring says",
    "measured.maps.component.import_map": "a list of options, and what each is",
    "measured.maps.machine.import_machine": "one import from file to map, in its steps",
}
# Names that classes of two rooms still share; a name that is gone from here does not come back.
SHARED = {
    "Balance", "Case", "Clutch", "Control", "Drive", "Engine", "Figures", "Flows", "Gearbox", "Line", "Row", "Run",
    "State", "_Trace",
}  # fmt: skip
MODULES = sorted(PACKAGE.rglob("*.py"))


def name_of(path: Path) -> str:
    return ".".join(("hevopt", *path.relative_to(PACKAGE).with_suffix("").parts)).removesuffix(
        ".__init__"
    )


NAMES = {name_of(path) for path in MODULES}


def imports_of(path: Path) -> set[str]:
    """Full names of the project's modules that a file imports."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] == "hevopt":
            for alias in node.names:
                full = f"{node.module}.{alias.name}"
                found.add(full if full in NAMES else node.module)
        elif isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names if alias.name.split(".")[0] == "hevopt"}
    return found


def room_of(name: str) -> str:
    """A module's room: the folder below the package it lies in, or its own name."""
    return name.split(".")[1] if "." in name else name


def floor_of(room: str) -> int:
    return next(i for i, rooms in enumerate(FLOORS) if room in rooms)


@pytest.mark.parametrize("path", MODULES, ids=name_of)
def test_rooms_import_downwards_only(path):
    room = room_of(name_of(path))
    if room == "hevopt":
        return
    for other in {room_of(name) for name in imports_of(path)} - {room, "hevopt"}:
        assert floor_of(other) < floor_of(room), f"{name_of(path)} imports {other}"
        assert room not in BLIND or other in BLIND[room], f"{name_of(path)} sees {other}"


def test_no_module_imports_itself_at_any_distance():
    graph = {name_of(path): imports_of(path) & NAMES for path in MODULES}
    TopologicalSorter(graph).prepare()  # raises CycleError with the circle


def test_folders_within_a_room_import_one_way():
    graph: dict[str, set[str]] = {}
    for path in MODULES:
        folder = name_of(path.parent / "__init__.py")
        others = {name.rpartition(".")[0] for name in imports_of(path) if name.count(".") > 2}
        inside = {other for other in others if room_of(other) == room_of(folder)} - {folder}
        if folder.count(".") > 1:
            graph.setdefault(folder, set()).update(inside)
    TopologicalSorter(graph).prepare()


def test_what_loops_are_compiled_with_counts_where_one_is_taken_from_the_disk():
    # The package's marker and names of types stand in no loop.
    apart = {"hevopt._compile", "hevopt.problem.arrays"}
    loops = [path for path in MODULES if fnmatch(path.name, "_*kernels.py")]
    for path in loops:
        for name in imports_of(path) - apart:
            file = f"{name.rpartition('.')[2]}.py"
            assert any(fnmatch(file, known) for known in _COMPILED_WITH), (
                f"{name_of(path)} uses {name}"
            )


@pytest.mark.parametrize("path", MODULES, ids=name_of)
def test_files_and_functions_fit_in_the_eye(path):
    text = path.read_text()
    assert text.count("\n") <= 300
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            lines = node.end_lineno - node.lineno + 1
            whole = f"{name_of(path)}.{node.name}".removeprefix("hevopt.")
            assert lines <= 50 or whole in LONG, f"{whole}: {lines} lines"


@pytest.mark.parametrize("path", [p for p in MODULES if p.name == "__init__.py"], ids=name_of)
def test_every_room_says_what_it_is_for(path):
    assert len(ast.get_docstring(ast.parse(path.read_text())) or "") > 20


def test_a_class_name_means_one_thing():
    places = defaultdict(list)
    for path in MODULES:
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.ClassDef):
                places[node.name].append(name_of(path))
    shared = {name: modules for name, modules in places.items() if len(modules) > 1}
    assert shared.keys() <= SHARED, {name: shared[name] for name in shared.keys() - SHARED}


def fields_named(doc: str) -> list[str]:
    """The names that lines "name, other: what they are" of a docstring describe."""
    parts = [part for line in doc.split("\n")[1:] for part in line.split("; ")]
    heads = (re.match(r"\s*([a-z_0-9]+(?:, [a-z_0-9]+)*): ", part) for part in parts)
    return [name for head in heads if head for name in head.group(1).split(", ")]


@pytest.mark.parametrize("path", MODULES, ids=name_of)
def test_docstrings_of_classes_describe_fields_that_are_there(path):
    """A field may be called without its unit."""
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.ClassDef) and ast.get_docstring(node):
            own = [part for part in node.body if isinstance(part, ast.AnnAssign | ast.FunctionDef)]
            names = [
                part.target.id if isinstance(part, ast.AnnAssign) else part.name for part in own
            ]
            if any(isinstance(part, ast.AnnAssign) for part in own):
                for name in fields_named(ast.get_docstring(node)):
                    assert any(known == name or known.startswith(f"{name}_") for known in names), (
                        f"{node.name} has no {name}"
                    )


def test_tests_mirror_the_rooms():
    rooms = {path.parent.relative_to(PACKAGE) for path in MODULES} - {Path(".")}
    apart = {Path("benchmarks"), Path("fuzzing"), Path("proofs"), Path("data"), Path(".")}
    for path in (ROOT / "tests").rglob("*.py"):
        folder = path.parent.relative_to(ROOT / "tests")
        assert folder in rooms | apart, f"{folder} mirrors no room"


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


_LOADED = """
import sys, hevopt
from contextlib import suppress
sys.argv[0] = "hevopt"
if sys.argv[1:]:
    from hevopt.cli import main
    with suppress(SystemExit):
        main()
sys.exit(", ".join({"numba", "pandas", "matplotlib", "scipy"} & set(sys.modules)))
"""


@pytest.mark.parametrize("words", ["", "--help", "compare --help", "cycles"])
def test_neither_importing_hevopt_nor_help_loads_what_is_slow_to_load(words):
    command = [sys.executable, "-c", _LOADED, *words.split()]
    assert subprocess.run(command, capture_output=True, text=True).stderr.strip() == ""


_PLANNED = """
from hevopt.sweeps.plan.jobs import jobs_of
print(*jobs_of("C2", ["nedc"], ["dp"], [({}, [(0, 2.0)])]))
"""


@pytest.mark.parametrize(
    "work, spared",
    [
        ("hevopt.load_architecture('C2'), hevopt.load_cycle('nedc')", "numba"),
        ("hevopt.compare", "hevopt.car_files.load"),
        ("hevopt.compare", "pydantic"),
        ("hevopt.STRATEGIES, hevopt.sweep", "numba"),
        (_PLANNED, "numba"),
    ],
    ids=[
        "reading cars without loops",
        "computing without models of files",
        "computing without checks of settings",
        "asking for a sweep",
        "planning one with weights on NOx",
    ],
)
def test_reading_and_computing_can_be_loaded_at_once_by_two_processes(work, spared):
    code = f"import sys, hevopt\n{work}\nsys.exit({spared!r} in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code]).returncode == 0
