"""The documentation: every command and example on it runs, and the site builds without a warning."""

import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from hevopt.cli import main

ROOT = Path(__file__).parents[1]
PAGES = sorted((ROOT / "docs").rglob("*.md"))
README = (ROOT / "README.md").read_text()


def blocks(language: str) -> list:
    """The pages' blocks of a language; those the README's own test runs line by line are left to it."""
    return [
        pytest.param(block, id=f"{page.stem}-{n}")
        for page in PAGES
        for n, block in enumerate(re.findall(rf"```{language}\n(.*?)```", page.read_text(), re.S))
        if not set(block.splitlines()) <= set(README.splitlines())
    ]


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A folder with the shipped files of a checkout, and a car of the user's own."""
    for name in ("architectures", "cycles", "examples"):
        (tmp_path / name).symlink_to(ROOT / name)
    text = (ROOT / "architectures" / "C2.toml").read_text()
    (tmp_path / "mine.toml").write_text(text.replace('name = "C2"', 'name = "mine"'))
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize("block", blocks("sh"))
def test_commands_of_the_pages_work(block, folder, monkeypatch, capsys):
    for command in block.splitlines():
        words = shlex.split(command)
        if words[:3] == ["hevopt", "architectures", "new"]:
            (folder / f"{words[3]}.toml").unlink(missing_ok=True)
        monkeypatch.setattr("sys.argv", words)
        with pytest.raises(SystemExit) as stop:
            main()
        assert not stop.value.code, f"{command}: {capsys.readouterr().err}"


@pytest.mark.parametrize("block", blocks("python"))
def test_examples_of_the_pages_work(block, folder):
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", block], capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr


def test_the_site_builds_without_a_warning(tmp_path):
    command = [
        sys.executable,
        "-m",
        "mkdocs",
        "build",
        "--strict",
        "--site-dir",
        str(tmp_path / "site"),
    ]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "site" / "theory" / "certificates.html").is_file()
