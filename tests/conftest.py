"""Problems that many tests share, built once."""

from functools import cache

import pytest
from command_line import call
from slow import slow

ARCHITECTURES = ("A", "B", "C1", "C2", "D", "E")
HYBRIDS = ("C1", "C2", "D", "E")
CYCLES = (
    "nedc", "wltc_class3b", "udds", "hwfet", "us06", "ftp75", "cadc_urban", "cadc_road",
    "cadc_motorway130",
)  # fmt: skip
# What compiles most comes first, loops of engines and plants beside those of strategies, so that no two workers
# compile the same; then what takes long, so that short files fill the end.
FIRST = (
    "mean_value/", "bounds/test_bounds", "forward/", "studies/test_comparison", "tipin/", "test_docs",
    "sweeps/workers/", "sweeps/test_sweep_cli", "sweeps/", "pages/", "test_notebooks", "bounds/", "strategies/",
)  # fmt: skip


@pytest.hookimpl(tryfirst=True)  # before tests are left out by their marks
def pytest_collection_modifyitems(items):
    def place(item):
        name = item.nodeid.removeprefix("tests/")
        return next((n for n, start in enumerate(FIRST) if name.startswith(start)), len(FIRST))

    listed = slow()
    for item in items:
        name = item.nodeid.removeprefix("tests/").split("[")[0]
        dear = name in listed or name.split("::")[0] in listed
        if dear and not item.get_closest_marker("long"):
            item.add_marker("slow")
    items.sort(key=place)


@cache
def _problem(architecture: str, cycle: str):
    from hevopt import build_problem, load_architecture, load_cycle

    return build_problem(load_architecture(architecture), load_cycle(cycle), allow_shortfall=True)


@cache
def _compared(cycle: str):
    """A comparison, and its trajectories by car and strategy."""
    from hevopt import compare

    driven = {}

    def observe(case, row, plan, trajectory):
        driven[row.architecture, row.strategy] = trajectory

    return compare(cycle, allow_shortfall=True, observe=observe), driven


@pytest.fixture
def problem_of():
    """(architecture, cycle) -> problem, cached over the whole run."""
    return _problem


@pytest.fixture
def comparison_of():
    """cycle -> comparison of everything on it, cached over the whole run."""
    return lambda cycle: _compared(cycle)[0]


@pytest.fixture
def driven_of():
    """cycle -> (architecture, strategy) -> trajectory of that comparison."""
    return lambda cycle: _compared(cycle)[1]


@pytest.fixture(scope="session")
def beginnings(tmp_path_factory):
    """A folder with the shipped cycles, each up to its first standstill after 100 s."""
    from hevopt.files.lookup import shipped_folder

    made = tmp_path_factory.mktemp("cycles")
    for path in shipped_folder("cycles").glob("*.csv"):
        kept = []
        for line in path.read_text().splitlines(keepends=True):
            kept.append(line)
            values = line.split(",")
            if values[0].isdigit() and float(values[0]) >= 100 and float(values[1]) == 0:
                break
        (made / path.name).write_text("".join(kept))
    return made


@pytest.fixture
def quick(beginnings, monkeypatch):
    """The shipped cycles are short: what commands do is the same, and they do it soon."""
    from hevopt.files.lookup import shipped_folder as real

    monkeypatch.setattr(
        "hevopt.files.lookup.shipped_folder",
        lambda kind: beginnings if kind == "cycles" else real(kind),
    )


@pytest.fixture
def hevopt(monkeypatch, capsys, tmp_path):
    """Run the command line in an empty folder."""
    monkeypatch.chdir(tmp_path)
    return lambda *words: call(monkeypatch, capsys, *words)
