"""A controller of one's own on the command line: in table, JSON and page, one message for what it does wrong."""

import json
from pathlib import Path

import pytest

RULES = """
import sys
import numpy as np
from hevopt import policy

def decided(now, more=0.0):
    price = 6e-8 * (1 + more + 10 * (now.soc_end_min - now.soc))
    return np.argmin(np.where(now.usable, now.fuel_kg + price * now.drain_j, np.inf))

honest = policy(lambda now: decided(now))
same = policy(lambda now: decided(now))

@policy
def peeking(now):
    table = sys._getframe(1).f_locals["self"].problem.table
    return decided(now, 0.5 * np.sign(table.battery_power_w[min(now.k + 1, 8)].mean()))

@policy
def raising(now):
    return 1 / 0

@policy
def nonsense(now):
    return "left"

@policy
def stubborn(now):
    return int(np.flatnonzero(~now.usable)[0]) if not now.usable.all() else 0

def whole(problem):
    return np.argmax(problem.table.feasible, axis=1)

dp = honest
"""
SHORT = "time_s,speed_kmh\n0,0\n5,0\n8,10\n15,40\n18,42\n40,40\n45,20\n50,0\n55,0\n60,0\n"
C2 = ("--architectures", "C2", "--cycle", "short.csv")


@pytest.fixture
def said(hevopt):
    Path("rules.py").write_text(RULES)
    Path("short.csv").write_text(SHORT)
    return hevopt


def test_policies_stand_in_table_json_and_page_and_what_fails_costs_no_other_row(said):
    bad = [f"--policy=rules.py:{name}" for name in ("raising", "nonsense", "stubborn")]
    done = said(
        "compare", *C2, "--strategies", "dp", "--policy", "rules.py:honest", *bad,
        "--json", "--report", "page.html", "--save", "all.json.gz",
    )  # fmt: skip
    assert done.status == 3
    found = json.loads(done.out)
    assert [row["strategy"] for row in found["rows"]] == [
        "dp", "honest", "raising", "nonsense", "stubborn",
    ]  # fmt: skip
    assert found["causal"] == ["honest"] and "rules.py" in found["inputs"]
    assert [row["fuel_l_per_100km"] is None for row in found["rows"]] == [False] * 2 + [True] * 3
    lines = done.err.splitlines()
    assert len(lines) == 3 and "raising raised ZeroDivisionError" in lines[0]
    assert "nonsense: the rule chose 'left' at step 0" in lines[1]
    assert "which cannot be used there; choose among np.flatnonzero(now.usable)" in lines[2]
    page = Path("page.html").read_text()
    assert "honest" in page and "raising raised ZeroDivisionError" in page
    assert said("report", "all.json.gz", "--out", "again.html").status == 0


def test_a_peeking_one_is_told_in_table_and_page(said):
    done = said(
        "compare", *C2, "--strategies=dp", "--policy=rules.py:peeking", "--report=page.html"
    )
    assert done.status == 0, done.err
    assert "not causal, C2 peeking: at step " in done.out and "peeking†" not in done.out
    assert "Not causal, C2 peeking: at step " in Path("page.html").read_text()


def test_a_name_that_is_taken_gives_way_to_the_reference(said):
    done = said("compare", *C2, "--strategies", "rules.py:same", "--policy=rules.py:dp", "--json")
    names = [row["strategy"] for row in json.loads(done.out)["rows"]]
    assert names == ["rules.py:same", "rules.py:dp"]


def test_run_takes_one_either_way(said):
    for words in (["--policy", "rules.py:whole"], ["--strategy", "rules.py:honest"]):
        done = said("run", "C2", "--cycle", "short.csv", *words, "--json")
        assert done.status in (0, 3), done.err
    (row,) = json.loads(done.out)["rows"]
    assert row["strategy"] == "rules.py:honest"
    twice = said("run", "C2", "--policy", "rules.py:whole", "--strategy", "dp")
    assert twice.status == 2 and "name one strategy here" in twice.err


def test_a_study_names_them_from_where_it_lies(said):
    Path("studies").mkdir()
    for name in ("rules.py", "short.csv"):
        Path(name).rename(Path("studies") / name)
    study = Path("studies/mine.toml")
    study.write_text(
        'cycle = "./short.csv"\narchitectures = ["C2"]\nstrategies = ["rules.py:honest"]\n'
    )
    done = said("compare", study, "--json")
    assert [row["strategy"] for row in json.loads(done.out)["rows"]] == ["rules.py:honest"]
    assert said("validate", study).status == 0
    study.write_text(study.read_text().replace("honest", "honst"))
    wrong = said("validate", study)
    assert wrong.status == 2 and "'honst' not found; close matches: honest" in wrong.out + wrong.err


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (["--policy", "nix.py:f"], "nix.py not found"),
        (["--policy", "rules.py"], "needed: FILE.py:FUNCTION or MODULE:FUNCTION"),
        (["--policy", "no_such_module:f"], "module 'no_such_module' cannot be imported"),
        (["--strategies=rules.py:same", "--policy=./rules.py:dp", "--policy=rules.py:dp"], ""),
    ],
)
def test_what_is_no_policy_is_one_message_before_anything_is_solved(said, words, text):
    done = said("compare", *C2, *words)
    if text:
        assert done.status == 2 and text in done.err and not done.out
    else:
        assert done.status == 0
