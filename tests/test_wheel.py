"""The package as others install it: one version, a wheel with all it needs, commands far from the checkout."""

import json
import os
import subprocess
import sys
import sysconfig
import tomllib
import venv
import zipfile
from pathlib import Path

import pytest

import hevopt

ROOT = Path(__file__).parents[1]
_CYCLE = "time_s,speed_kmh\n" + "".join(f"{k},{min(4 * k, 40, 160 - 4 * k)}\n" for k in range(41))


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    """The wheel of the checkout."""
    folder = tmp_path_factory.mktemp("wheel")
    command = [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(folder)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    (path,) = folder.glob("*.whl")
    return path


@pytest.fixture(scope="module")
def scripts(wheel, tmp_path_factory):
    """The commands' folder of an environment that has the wheel, and what hevopt needs from the one that runs."""
    folder = tmp_path_factory.mktemp("fresh")
    venv.create(folder, with_pip=False, symlinks=True)
    pip = [sys.executable, "-m", "pip", "--python", str(folder / "bin" / "python")]
    words = ["install", "-q", "--no-index", "--no-deps", "--disable-pip-version-check", str(wheel)]
    done = subprocess.run([*pip, *words], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    (site,) = folder.glob("lib/python*/site-packages")
    (site / "others.pth").write_text(sysconfig.get_path("purelib") + "\n")
    return folder / "bin"


def test_the_version_stands_in_one_place_and_is_that_of_wheel_and_citation(wheel):
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    assert "version" not in project and project["dynamic"] == ["version"]
    assert wheel.name.startswith(f"hevopt-{hevopt.__version__}-")
    assert f"\nversion: {hevopt.__version__}\n" in (ROOT / "CITATION.cff").read_text()


def test_a_wheel_has_every_file_that_the_package_reads_and_no_other(wheel):
    names = set(zipfile.ZipFile(wheel).namelist())
    tracked = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True)
    for file in tracked.stdout.split():
        if file.startswith(("architectures/", "cycles/")):
            assert f"hevopt/data/{file}" in names
        elif file.startswith("hevopt/"):
            assert file in names
    assert {name.split("/")[0].split("-")[0] for name in names} == {"hevopt"}
    assert not [name for name in names if name.endswith((".nbi", ".nbc", ".pyc"))]


def test_an_installed_wheel_compares_cars_and_makes_their_page_far_from_the_checkout(
    scripts, tmp_path
):
    (tmp_path / "short.csv").write_text(_CYCLE)
    kept = {k: v for k, v in os.environ.items() if k not in ("PYTHONPATH", "PYTHONHOME")}
    environment = kept | {"NUMBA_DISABLE_JIT": "1"}  # nothing is compiled for one short run

    def told(*words: str) -> str:
        done = subprocess.run(
            [scripts / "hevopt", *words],
            cwd=tmp_path,
            env=environment,
            capture_output=True,
            text=True,
        )
        assert done.returncode == 0, done.stderr
        return done.stdout

    where = "import hevopt; print(hevopt.__file__)"
    command = [scripts / "python", "-c", where]
    done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True)
    assert Path(done.stdout.strip()).is_relative_to(scripts.parent)
    assert told("--version") == f"hevopt {hevopt.__version__}\n"
    words = "compare --cycle short.csv --architectures A,B --strategies baseline,start_stop".split()
    rows = json.loads(told(*words, "--json", "--report", "page.html"))["rows"]
    assert {row["strategy"] for row in rows} == {"baseline", "start_stop"}
    assert {row["status"] for row in rows} == {"ok"}
    assert (tmp_path / "page.html").stat().st_size > 1e6  # with the script that draws it
