"""Everything the README tells a reader to run is run, and what it shows is what is printed."""

import importlib.util
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from hevopt.cli import main

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text()
BLOCKS = [block.splitlines() for block in re.findall(r"```sh\n(.*?)```", README, re.S)]
# Blocks of commands, each run from top to bottom in one folder; the two that set up are CI's.
SESSIONS = [block for block in BLOCKS if block[0].startswith("hevopt ")]
SET_UPS = [line for block in BLOCKS if block not in SESSIONS for line in block]


@pytest.mark.parametrize("session", SESSIONS, ids=lambda session: " ".join(session[0].split()[1:3]))
def test_commands_of_the_readme_work(session, monkeypatch, tmp_path, capsys):
    for folder in ("architectures", "cycles", "examples"):
        (tmp_path / folder).symlink_to(ROOT / folder)
    monkeypatch.chdir(tmp_path)
    for command in session:
        monkeypatch.setattr("sys.argv", shlex.split(command))
        with pytest.raises(SystemExit) as stop:
            main()
        assert not stop.value.code, f"{command}: {capsys.readouterr().err}"


@pytest.mark.parametrize("example", re.findall(r"```python\n(.*?)```", README, re.S))
def test_python_example_of_the_readme_works(example):
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", example], capture_output=True, text=True
    )
    figures = re.fullmatch(r"(0\.\d+) kg, at least (0\.\d+) kg \(.+\)\n", done.stdout)
    assert figures, done.stderr
    assert 0.99 < float(figures[2]) / float(figures[1]) <= 1


def test_set_up_commands_are_the_two_that_ci_and_this_suite_were_started_with():
    assert len(SET_UPS) == 2
    assert SET_UPS[0].endswith("pip install . && hevopt compare")
    assert SET_UPS[1].endswith('pip install -e ".[test]" && pytest')
    assert "grep -m1 'pytest$' README.md" in (ROOT / ".ci" / "run").read_text()


def test_the_table_shown_is_the_table_printed(comparison_of):
    shown = {}
    strategies = {row.strategy for row in comparison_of("nedc").rows}
    for line in README.splitlines():
        words = line.replace("†", "").split()
        if len(words) > 10 and words[1] in strategies:
            shown[words[0], words[1]] = words[2:]
    rows = comparison_of("nedc").rows
    assert set(shown) == {(row.architecture, row.strategy) for row in rows}
    for row in rows:
        words = shown[row.architecture, row.strategy]
        assert float(words[0]) == pytest.approx(row.fuel_l_per_100km, abs=2e-3)
        assert float(words[9]) == pytest.approx(row.bound_l_per_100km, abs=2e-3)


def test_the_page_of_strategies_is_made(monkeypatch, tmp_path, capsys):
    # One cycle here; the page in reports/ is made over all of them, in about a minute.
    monkeypatch.setattr("hevopt.files.lookup.shipped_names", lambda kind, suffix: ["hwfet"])
    page = tmp_path / "strategies.md"
    monkeypatch.setattr("sys.argv", ["hevopt", "strategies", "--out", str(page)])
    with pytest.raises(SystemExit) as stop:
        main()
    assert not stop.value.code, capsys.readouterr().err
    text, committed = page.read_text(), (ROOT / "reports" / "strategies.md").read_text()
    for name in ("conventional", "dp", "convex", "mpc", "a_ecms", "sdp"):
        assert f"| `{name}` |" in text and f"| `{name}` |" in committed
    assert "## C2, gap %" in text and "hwfet" in text


def test_benchmarks_measure_the_kernel_and_name_every_figure():
    path = ROOT / "tests" / "benchmarks" / "run.py"
    spec = importlib.util.spec_from_file_location("benchmarks", path)
    benchmarks = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(benchmarks)
    problem = benchmarks.foreign_problem()
    call, count = benchmarks.backward_call(problem, 101)
    assert call().shape == (1401, 1, 101) and count > 1e6
    committed = (ROOT / "reports" / "benchmarks.md").read_text()
    for figure in ("dp kernel", "ratio", "first time", "--help", "lower-bound DP", "nodes 201"):
        assert figure in committed
