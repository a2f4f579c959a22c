"""What the README tells a reader to run is run, its picture can be made, and its cars are those that there are."""

import re
import shlex
import subprocess
import sys
from pathlib import Path
from typing import get_args

import pytest

from hevopt.car.templates import CouplingKind
from hevopt.cli import main

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text()
BLOCKS = [block.splitlines() for block in re.findall(r"```sh\n(.*?)```", README, re.S)]
# Commands, run from top to bottom in one folder; the two blocks that set up are CI's.
COMMANDS = [line for block in BLOCKS for line in block if line.startswith("hevopt ")]
SET_UPS = [line for block in BLOCKS for line in block if line not in COMMANDS]


def test_commands_of_the_readme_work_with_its_own_car(monkeypatch, tmp_path, capsys):
    (car,) = re.findall(r"```toml\n(.*?)```", README, re.S)
    (tmp_path / "mine.toml").write_text(car)
    monkeypatch.chdir(tmp_path)
    assert COMMANDS
    for command in COMMANDS:
        monkeypatch.setattr("sys.argv", shlex.split(command))
        with pytest.raises(SystemExit) as stop:
            main()
        assert not stop.value.code, f"{command}: {capsys.readouterr().err}"


def test_python_example_of_the_readme_works():
    (example,) = re.findall(r"```python\n(.*?)```", README, re.S)
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


def test_the_table_of_cars_has_every_coupling_and_no_other():
    cars = README.split("## Which cars")[1].split("\n## ")[0]
    named = set(re.findall(r"`(\w+)`", cars)) - {"soc_end"}
    assert named == set(get_args(CouplingKind))


def test_the_readme_is_short_and_what_it_points_to_is_there():
    assert len(README.encode()) <= 6144
    for link in re.findall(r"\]\(([^)]+)\)", README):
        assert (ROOT / link).exists(), link
    assert (ROOT / "docs" / "picture.png").stat().st_size < 100_000
