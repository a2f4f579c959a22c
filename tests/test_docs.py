"""The documentation: every command and example on it runs, and the site builds without a warning."""

import re
import shlex
import shutil
import subprocess
import sys
from dataclasses import fields
from pathlib import Path

import pytest
from benchmarks import run, track
from matplotlib import pyplot

import hevopt
from hevopt.bounds import certificate
from hevopt.cli import main
from hevopt.strategies import dp
from hevopt.studies.settings import Settings

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
    for name in ("architectures", "cycles"):
        (tmp_path / name).symlink_to(ROOT / name)
    shutil.copytree(ROOT / "examples", tmp_path / "examples")
    text = (ROOT / "architectures" / "C2.toml").read_text()
    (tmp_path / "mine.toml").write_text(text.replace('name = "C2"', 'name = "mine"'))
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize("block", blocks("sh"))
def test_commands_of_the_pages_work(block, folder, quick, beginnings, monkeypatch, capsys):
    # The processes of a sweep read the short cycle as a file.
    study, cycle = folder / "examples" / "c2_engine.toml", str(beginnings / "nedc.csv")
    study.write_text(study.read_text().replace('["nedc"]', f"[{cycle!r}]"))
    for command in block.splitlines():
        words = shlex.split(command)
        if words[:3] == ["hevopt", "architectures", "new"]:
            (folder / f"{words[3]}.toml").unlink(missing_ok=True)
        monkeypatch.setattr("sys.argv", words)
        with pytest.raises(SystemExit) as stop:
            main()
        assert not stop.value.code, f"{command}: {capsys.readouterr().err}"


@pytest.mark.parametrize("block", blocks("python"))
def test_examples_of_the_pages_work(block, folder, monkeypatch):
    monkeypatch.setattr("hevopt.strategies._registered", {})
    # Warnings are errors here as everywhere in the tests.
    exec(compile(block, "example", "exec"), {"__name__": "__main__"})
    pyplot.close("all")


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


def test_every_public_name_has_its_place_in_the_reference():
    pages = "".join(page.read_text() for page in (ROOT / "docs" / "reference").glob("*.md"))
    shown = set(re.findall(r"^::: (\S+)$", pages, re.M))
    for name, home in hevopt._HOME.items():
        assert f"{home}.{name}" in shown or home in shown, name


def test_numbers_of_the_theory_are_those_of_the_code():
    text = (ROOT / "docs" / "theory" / "dynamic_programming.md").read_text()
    numbers = {
        "ENERGY_NODES": f"{dp.ENERGY_NODES}",
        "_QUICK": "; ".join(
            ", ".join(f"{part:g}" for part in parts) for parts in zip(*dp._QUICK, strict=True)
        ),
        "_BANDS": ", ".join(f"{band:g}" for band in dp._BANDS),
        "_GAIN_WORTH_MORE": f"{1e5 * dp._GAIN_WORTH_MORE:g}·10⁻⁵ of the cost",
        "_PROMISE_TOLERANCE": f"{100 * dp._PROMISE_TOLERANCE:g} %",
        "_FINER": f"{dp._FINER}",
    }
    for name, value in numbers.items():
        assert f"| {value} | `{name}` |" in text
    assert f"| {dp._GENTLE:g}, or 10⁴ " in text and dp._STEEP == 1e4
    proofs = (ROOT / "docs" / "theory" / "certificates.md").read_text()
    assert f"above {100 * certificate.TARGET_GAP:g} %" in " ".join(proofs.split())
    assert [f"{n:,}".replace(",", " ") in proofs for n in certificate.LOWER_DP_NODES] == [True] * 2


def test_every_setting_of_a_study_has_its_line():
    page = (ROOT / "docs" / "reference" / "files.md").read_text()
    table = page.split("## A study")[1].split("\n## ")[0]
    for setting in {each.name for each in fields(Settings)} - {"changes"}:
        assert f"`{setting}`" in table, setting


def test_the_table_shown_is_the_table_printed(comparison_of):
    page = (ROOT / "docs" / "reference" / "columns.md").read_text()
    shown = {}
    strategies = {row.strategy for row in comparison_of("nedc").rows}
    for line in page.splitlines():
        words = line.replace("†", "").split()
        if len(words) > 10 and words[1] in strategies:
            shown[words[0], words[1]] = words[2:]
    rows = comparison_of("nedc").rows
    assert set(shown) == {(row.architecture, row.strategy) for row in rows}
    for row in rows:
        words = shown[row.architecture, row.strategy]
        assert float(words[0]) == pytest.approx(row.fuel_l_per_100km, abs=2e-3)
        assert float(words[9]) == pytest.approx(row.bound_l_per_100km, abs=2e-3)


def test_the_page_of_strategies_is_made(quick, monkeypatch, tmp_path, capsys):
    # One cycle here; the page in reports/ is made over all of them, in about a minute.
    monkeypatch.setattr("hevopt.files.lookup.shipped_names", lambda kind, suffix: ["cadc_urban"])
    page = tmp_path / "strategies.md"
    monkeypatch.setattr("sys.argv", ["hevopt", "strategies", "--out", str(page)])
    with pytest.raises(SystemExit) as stop:
        main()
    assert not stop.value.code, capsys.readouterr().err
    text, committed = page.read_text(), (ROOT / "reports" / "strategies.md").read_text()
    for name in ("conventional", "dp", "convex", "mpc", "a_ecms", "sdp"):
        assert f"| `{name}` |" in text and f"| `{name}` |" in committed
    assert "## C2, gap %" in text and "cadc_urban" in text


def test_benchmarks_measure_the_kernel_and_name_every_figure():
    problem = run.foreign_problem()
    call, count = run.backward_call(problem, 101)
    assert call().shape == (1401, 1, 101) and count > 1e6
    committed = (ROOT / "reports" / "benchmarks.md").read_text()
    for figure in ("dp kernel", "ratio", "first time", "--help", "lower-bound DP", "nodes 201"):
        assert figure in committed


def test_figures_of_a_commit_stand_beside_those_of_the_newest_before_it_on_such_a_machine(tmp_path):
    paths = [
        track.written(tmp_path, number, "abc", {"machine": machine, "figures": {"help_s": s}})
        for number, machine, s in ((98, "this", 0.3), (99, "this", 0.2), (100, "other", 0.4), (101, "this", 0.1))
    ]  # fmt: skip
    assert track.before(tmp_path, paths[3], "this") == {"help_s": 0.2}
    assert track.before(tmp_path, paths[0], "this") == {}
