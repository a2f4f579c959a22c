"""Strategies from outside in a sweep: every worker finds them; a new text is run again; what is lost is refused."""

from dataclasses import replace

import numpy as np
import pytest
from sweep_runs import SPEEDS_MPS, sweep_here

from hevopt import DataError, register
from hevopt import strategies as known
from hevopt.sweeps.plan.study_file import read_study
from hevopt.sweeps.run import WORK, plan_of
from hevopt.sweeps.store.reading import open_to_read
from hevopt.sweeps.workers.work import run_job

RULE = """import numpy as np
from hevopt import policy, stepwise

def least_fuel(problem):
    return stepwise(problem, lambda now: np.argmin(np.where(now.usable, now.fuel_kg, np.inf)))

def broken(problem):
    return 1 / 0

@policy
def least_again(now):
    return np.argmin(np.where(now.usable, now.fuel_kg, np.inf))
"""


@pytest.fixture(autouse=True)
def nothing_stays_registered(monkeypatch):
    monkeypatch.setattr(known, "_registered", {})


@pytest.fixture
def study(tmp_path):
    """(strategies) -> a study of two designs on half a minute, beside a file of rules."""
    lines = "\n".join(f"{t},{speed}" for t, speed in enumerate(SPEEDS_MPS))
    (tmp_path / "short.csv").write_text(f"time_s,speed_mps\n{lines}\n")
    (tmp_path / "rules").mkdir()
    (tmp_path / "rules" / "rule.py").write_text(RULE)

    def write(*strategies):
        path = tmp_path / "study.toml"
        path.write_text(
            f'architecture = "C2"\ncycles = ["short.csv"]\nstrategies = {list(strategies)}\n'
            "[parameters]\nmachine.power_max_w = [14e3, 18e3]\n"
        )
        return path

    return write


def test_workers_run_it_and_a_failure_is_its_own(study, tmp_path):
    names = ("dp", "rules/rule.py:least_fuel", "rules/rule.py:broken")
    store = tmp_path / "s.sqlite"
    sweep_here(study(*names), store, WORK, workers=1)
    with open_to_read(store) as reader:
        records = list(reader.records())
    rows = {(r.design, r.strategy): r for r in records}
    assert len(rows) == 6
    for design in (0, 1):
        dp, own, broken = (rows[design, name] for name in names)
        assert own.ending == "ok" and own.row["strategy"] == names[1]
        assert dp.row["objective_l_per_100km"] < own.row["objective_l_per_100km"]
        assert own.row["objective_bound_l_per_100km"] <= own.row["objective_l_per_100km"]
        assert broken.ending == "failed"
        assert "raised ZeroDivisionError: division by zero (rule.py, line 8)" in str(broken.failure)


def test_a_registered_function_reaches_workers_by_where_it_stands(study, tmp_path):
    rule = tmp_path / "rules" / "rule.py"
    register("least", f"{rule}:least_again")
    plan = plan_of(read_study(study("least")))
    outcomes = [outcome for job in plan.jobs for outcome in run_job(job)]
    assert [outcome.ending for outcome in outcomes] == ["ok", "ok"]
    assert {case.strategy for case in plan.planned} == {"least"}
    assert str(rule) in plan.inputs
    register("argmin", np.argmin)  # any function of an importable module can be found
    job = plan_of(read_study(study("argmin"))).jobs[0]
    assert job.brought["argmin"].reference.endswith(":argmin")


def test_keys_hold_the_text_and_nothing_else_of_it(study, tmp_path):
    def keys():
        plan = plan_of(read_study(study("dp", "rules/rule.py:least_fuel")))
        return {case.strategy: case.key for case in plan.planned}

    before, job = keys(), plan_of(read_study(study("rules/rule.py:least_fuel"))).jobs[0]
    assert keys() == before
    (tmp_path / "rules" / "rule.py").write_text(RULE + "# changed\n")
    after = keys()
    assert before["dp"] == after["dp"]
    assert before["rules/rule.py:least_fuel"] != after["rules/rule.py:least_fuel"]
    (outcome,) = run_job(job)
    assert outcome.ending == "failed" and "changed after the sweep began" in str(outcome.failure)


def test_a_file_that_cannot_be_imported_fails_its_cases_alone(study, tmp_path):
    job = plan_of(read_study(study("dp", "rules/rule.py:least_fuel"))).jobs[0]
    rule = tmp_path / "rules" / "rule.py"
    rule.unlink()
    dp, own = run_job(job)
    assert dp.ending == "ok" and own.ending == "failed" and "not found" in str(own.failure)
    rule.write_text("import no_such_module\n" + RULE)
    job = plan_of(read_study(study("rules/rule.py:least_fuel"))).jobs[0]
    (own,) = run_job(replace(job, cases=job.cases[:1]))
    assert "cannot be imported: ModuleNotFoundError: No module named 'no_such_module'" in str(
        own.failure
    )


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("rules/rul.py:least_fuel", "not found; needed: FILE.py:FUNCTION or MODULE:FUNCTION"),
        ("rules/rule.py:leest_fuel", "function 'leest_fuel' not found; close matches: least_fuel"),
        ("short.csv:f", "module 'short.csv' cannot be imported"),
        ("no_such_module:f", "module 'no_such_module' cannot be imported"),
        ("wrong.py:f", "no Python that can be read"),
        ("dpp", "close matches: dp"),
        ("baseline", "baseline does not fit C2"),
        ("a lambda", "worker processes cannot import (a lambda"),
        ("inner", "put it into a file and register FILE.py:FUNCTION"),
    ],
)
def test_what_no_worker_could_import_is_refused_before_anything_runs(study, tmp_path, name, said):
    def inner(problem):
        return []

    (tmp_path / "wrong.py").write_text("def f(:\n")
    register("a lambda", lambda problem: [])
    register("inner", inner)
    with pytest.raises(DataError) as error:
        read_study(study("dp", name))
    assert said in str(error.value)


def test_checking_a_study_runs_no_code_of_it(study, tmp_path):
    (tmp_path / "rules" / "rule.py").write_text(
        "raise SystemExit(9)\ndef least_fuel(p):\n    pass\n"
    )
    assert read_study(study("rules/rule.py:least_fuel")).brought
