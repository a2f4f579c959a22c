"""The floors that pyproject.toml declares, and the tool that tries them all at once."""

import re
import tomllib
from pathlib import Path

import pytest
from lowest import TESTS, lowest

ROOT = Path(__file__).parents[1]
PROJECT = (ROOT / "pyproject.toml").read_text()


def _project(*dependencies: str, **extras: list[str]) -> dict:
    return {
        "build-system": {"requires": ["builder>=1.21"]},
        "project": {"name": "own", "dependencies": dependencies, "optional-dependencies": extras},
    }


def test_floors_of_build_dependencies_and_extras_are_held_once_with_their_markers():
    old, new = "a>=1.0; python_version < '3.13'", "a>=2.1; python_version >= '3.13'"
    held = lowest(_project(old, new, "b-c[d]>=3", e=["f>=4.5.6"], test=["own[e]", "f>=4.5.6"]))
    assert held == [
        "builder==1.21",
        "a==1.0; python_version < '3.13'",
        "a==2.1; python_version >= '3.13'",
        "b-c[d]==3",
        "f==4.5.6",
    ]


@pytest.mark.parametrize("requirement", ["a", "a==1", "a<2", "a>=1,<2", "owner"])
def test_a_requirement_without_a_plain_floor_is_refused(requirement):
    with pytest.raises(ValueError, match="has no floor"):
        lowest(_project(requirement))


def test_every_declared_floor_can_be_held_and_has_its_reason_beside_it():
    names = [re.split(r"[=\[]", pin)[0] for pin in lowest(tomllib.loads(PROJECT))]
    assert {"hatchling", "numpy", "ray", "pyarrow", "pytest"} <= set(names)
    for name in set(names) - {"hatchling"}:
        assert re.search(rf'^ +"{re.escape(name)}[\[>].*", +# \w', PROJECT, re.M), name


def test_the_tests_tried_with_the_lowest_versions_are_there():
    assert TESTS and all((ROOT / path).exists() for path in TESTS)
