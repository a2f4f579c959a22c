"""Strategies from outside: judged like shipped ones, and whatever they do wrong is one message in their row."""

import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from problems import random_problem

from hevopt import (
    DataError,
    InfeasibleError,
    Plan,
    SolverError,
    Strategy,
    compare,
    register,
    sensitivities,
    simulate,
    solve,
    stepwise,
)
from hevopt import strategies as known
from hevopt.pages.comparison.collect import Collector
from hevopt.pages.comparison.page import comparison_page

SHORT = "time_s,speed_kmh\n0,0\n5,0\n15,40\n40,40\n50,0\n60,0\n70,50\n110,50\n125,0\n130,0\n"
HOWTO = Path(__file__).parents[2] / "docs" / "howto" / "own_strategy.md"


@pytest.fixture(autouse=True)
def nothing_stays_registered(monkeypatch):
    monkeypatch.setattr(known, "_registered", {})


@pytest.fixture
def short(tmp_path):
    path = tmp_path / "short.csv"
    path.write_text(SHORT)
    return path


def least_fuel(problem):
    """Whatever burns least, kept within the window."""
    return stepwise(problem, lambda now: np.argmin(np.where(now.usable, now.fuel_kg, np.inf)))


def example():
    """The thermostat of the documentation: its text, and the function."""
    block = re.search(r"```python\n(.*?)```", HOWTO.read_text(), re.S)[1]
    text = block[block.index("def my_thermostat") :]
    names = {"np": np, "stepwise": stepwise, "compare": lambda *_, strategies: strategies}
    exec(text, names)
    return text, names["comparison"]


def test_a_thermostat_is_ten_lines():
    text, _ = example()
    assert len([line for line in text.splitlines() if line.strip()]) == 10


def test_the_thermostat_of_the_documentation_is_certified_in_table_and_page(short):
    _, strategies = example()
    collector = Collector()
    comparison = compare(short, "C2", strategies, observe=collector.observe)
    own, dp = comparison.rows
    assert (own.strategy, dp.strategy) == ("my_thermostat", "dp") and own.solved
    assert own.bound_l_per_100km <= own.fuel_l_per_100km and own.gap_percent > dp.gap_percent
    page = comparison_page(collector.results(comparison, "hevopt compare"))
    assert 'data-text="my_thermostat"' in page


def test_a_list_mixes_names_and_pairs_and_a_registered_name_is_known(short):
    register("mine", least_fuel, causal=True)
    mixed = compare(short, "C2", ["dp", ("other", least_fuel), "mine"])
    assert [row.strategy for row in mixed.rows] == ["dp", "other", "mine"]
    assert mixed.causal == {"mine"} and all(row.solved for row in mixed.rows)
    dp, other, mine = (row.fuel_corrected_l_per_100km for row in mixed.rows)
    assert dp < other == mine
    effects = sensitivities("A", short, {"least": least_fuel})
    assert {effect.strategy for effect in effects} == {"least"}


def test_a_registered_one_takes_part_where_it_says_so():
    from hevopt.strategies import fitting

    drives = frozenset({"start_stop", "power_management"})
    register("asked for", least_fuel)
    register("usual", least_fuel, usual=True)
    register("choosy", Strategy(least_fuel, needs=frozenset({"nox_cut"})))
    assert "asked for" not in fitting(drives) and "usual" in fitting(drives)
    assert "asked for" in fitting(drives, every=True)
    assert "choosy" not in fitting(drives, every=True)


def test_a_function_in_a_file_is_imported_when_it_is_used(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("helper.py").write_text("CHOICE = 0\n")
    rule = "import helper, numpy\ndef first(problem):\n    return [helper.CHOICE] * len(problem.table.time_s)\n"
    Path("rule.py").write_text(rule)
    register("first", "rule.py:first")
    problem = random_problem(3)
    control = np.argmax(problem.table.feasible, axis=1)
    if not (control == 0).all():
        with pytest.raises(SolverError, match="strategy first: control 0"):
            solve(problem, "first")
    Path("rule.py").write_text("raise RuntimeError('not today')\n")
    register("first", "rule.py:first")
    said = r"strategy first: .*rule.py:first cannot be imported: RuntimeError: not today \(rule.py, line 1\)"
    with pytest.raises(SolverError, match=said):
        solve(problem, "first")


def steps(problem):
    return len(problem.table.time_s)


def wrong_switch(problem):
    table = problem.table
    control = np.argmax(table.feasible, axis=1)
    control[1] = -7
    return control


WRONG = {
    "raises": (lambda p: 1 / 0, r"raised ZeroDivisionError: division by zero \(test_brought.py, line \d+\)"),
    "exits": (lambda p: sys.exit(3), r"raised SystemExit: 3"),
    "nothing": (lambda p: None, "it returned nothing; needed: "),
    "a word": (lambda p: "dp", "it returned a value of type str"),
    "a mapping": (lambda p: {}, "it returned a value of type dict"),
    "a wrong plan": (lambda p: Plan(None), "it returned nothing"),
    "too short": (lambda p: [0, 0], r"one control per step, \d+; found \(2,\)"),
    "too deep": (lambda p: np.zeros((steps(p), 1)), r"found \(\d+, 1\)"),
    "ragged": (lambda p: [[0], [0, 0]], "unequal rows"),
    "not a number": (lambda p: np.full(steps(p), np.nan), "control nan at step 0"),
    "between": (lambda p: np.full(steps(p), 0.5), "control 0.5 at step 0"),
    "flags": (lambda p: np.zeros(steps(p), bool), "not bool"),
    "out of range": (wrong_switch, "control -7 at step 1"),
    "no control": (lambda p: np.full(steps(p), 10**6), "control 1000000 at step 0"),
    "writes": (lambda p: p.table.fuel_kg.fill(0), "raised ValueError: .*read-only"),
    "by a rule": (lambda p: stepwise(p, lambda now: 10**6), "the rule chose 1000000 at step 0"),
    "by no rule": (lambda p: stepwise(p, lambda now: None), "the rule chose None at step 0"),
}  # fmt: skip


@pytest.mark.parametrize("kind", WRONG)
def test_what_it_does_wrong_is_one_error_that_names_it(kind):
    function, said = WRONG[kind]
    register("mine", function)
    with pytest.raises(SolverError, match=f"strategy mine:? .*{said}"):
        solve(random_problem(5), "mine")


def test_a_strategy_that_fails_costs_no_other_row(short):
    wanted = {"dp": None, **{kind: function for kind, (function, _) in WRONG.items()}}
    comparison = compare(short, "C2", wanted)
    solved = [row.strategy for row in comparison.rows if row.solved]
    assert solved == ["dp"] and len(comparison.rows) == 1 + len(WRONG)
    assert comparison.failures.keys() == {f"C2 {kind}" for kind in WRONG}
    for row in comparison.rows[1:]:
        assert str(row.status).startswith(f"failed: strategy {row.strategy}")


def test_its_own_word_that_there_is_no_plan_stays_one():
    def gives_up(problem):
        raise InfeasibleError("no plan for this")

    register("mine", gives_up)
    with pytest.raises(InfeasibleError, match="strategy mine: no plan for this"):
        solve(random_problem(5), "mine")


@pytest.mark.parametrize(
    ("strategies", "said"),
    [
        (3, "needed: a name, a list of names and pairs"),
        ([least_fuel], "needed: a name, a list of names and pairs"),
        ({"mine": 3}, "strategy mine: a int is no function; needed: a function from Problem"),
        ({"dp": least_fuel}, "strategy name 'dp': it is taken"),
        ({"all": least_fuel}, "strategy name 'all': it is taken"),
        ({"a,b": least_fuel}, "without commas"),
        ({"": least_fuel}, "needed: text on one line"),
        ({5: least_fuel}, "needed: text on one line"),
        ({"x" * 81: least_fuel}, "allowed: up to 80 characters"),
        ({"mine": "nix.py:f"}, "nix.py not found; needed: FILE.py:FUNCTION or MODULE:FUNCTION"),
        ({"mine": "no_such_module:f"}, "module 'no_such_module' cannot be imported"),
        ({"mine": "f"}, "strategy 'f'; needed: FILE.py:FUNCTION"),
        ({"mine": "x.py:a b"}, "needed: FILE.py:FUNCTION"),
        ([("mine", least_fuel), ("mine", least_fuel)], "'mine' is given twice"),
        ("mine", "strategy 'mine' not found; close matches: baseline"),
    ],
)
def test_what_is_no_strategy_is_refused(strategies, said):
    with pytest.raises(DataError) as error:
        compare("hwfet", "C2", strategies)
    assert said in str(error.value)


@pytest.mark.parametrize("seed", range(6))
def test_stepwise_keeps_what_simulate_judges(seed):
    problem = random_problem(seed)
    seen = []

    def decide(now):
        seen.append(now)
        return int(np.flatnonzero(now.usable)[-1])

    try:
        plan = stepwise(problem, decide)
    except InfeasibleError:
        assert len(seen) < steps(problem)
        return
    trajectory = simulate(problem, plan.control)
    assert [now.energy_j for now in seen] == trajectory.energy_j[:-1].tolist()
    assert [now.mode for now in seen[1:]] == trajectory.mode[:-1].tolist()
    burnt = [
        now.fuel_kg[c] + now.switch_fuel_kg[c] for now, c in zip(seen, plan.control, strict=True)
    ]
    assert burnt == trajectory.fuel_kg.tolist()
    for now, chosen in zip(seen, plan.control, strict=True):
        assert now.usable[chosen] and now.step_s == problem.table.step_s[now.k]


def test_a_step_that_leaves_nothing_says_where():
    problem = random_problem(5)
    full = min(
        (p for p in map(random_problem, range(40)) if p.table.feasible.all()),
        key=lambda p: len(p.table.time_s),
        default=problem,
    )
    from dataclasses import replace

    reject = full.table.reject.copy()
    reject[1] = 1
    with pytest.raises(InfeasibleError, match=r"at step 1 \(t = .* no control is left"):
        stepwise(
            replace(full, table=replace(full.table, reject=reject)),
            lambda now: int(np.argmax(now.usable)),
        )


def test_an_interrupt_inside_a_strategy_stays_one():
    def interrupted(problem):
        raise KeyboardInterrupt

    register("mine", interrupted)
    with pytest.raises(KeyboardInterrupt):
        solve(random_problem(5), "mine")

    def compiled(problem):
        try:
            raise KeyboardInterrupt
        except KeyboardInterrupt as error:
            raise SystemError("returned a result with an exception set") from error

    register("mine", compiled)
    with pytest.raises(SystemError):
        solve(random_problem(5), "mine")


def test_importing_hevopt_for_its_names_imports_no_strategy():
    code = "import sys, hevopt; sys.exit('hevopt.strategies' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code]).returncode == 0
