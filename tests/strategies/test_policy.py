"""Policies: shown what they declare to know, judged like all others, and marked causal only if they are."""

import json
import re
import sys
from pathlib import Path

import numpy as np
import pytest
from command_line import call
from problems import random_problem

from hevopt import (
    DataError,
    SolverError,
    build_problem,
    compare,
    load_architecture,
    load_cycle,
    policy,
    register,
    simulate,
    solve,
    stepwise,
)
from hevopt import strategies as known
from hevopt.output.file_tables import result_json
from hevopt.output.terminal_tables import comparison_notes
from hevopt.problem.rows import rows_ahead, with_rows
from hevopt.strategies import brought, is_causal
from hevopt.strategies.installed import installed

CORNERS = {0: 0, 5: 0, 15: 40, 40: 40, 50: 0, 55: 0, 65: 50, 80: 50, 95: 0, 100: 0}
SECONDS = np.arange(101)
SPEEDS = np.interp(SECONDS, list(CORNERS), list(CORNERS.values()))
SHORT = "time_s,speed_kmh\n" + "".join(f"{t},{v:g}\n" for t, v in zip(SECONDS, SPEEDS, strict=True))
PRICE_KGPJ = 6e-8


@pytest.fixture(autouse=True)
def nothing_stays(monkeypatch):
    monkeypatch.setattr(known, "_registered", {})
    yield
    installed.cache_clear()


@pytest.fixture
def short(tmp_path):
    path = tmp_path / "short.csv"
    path.write_text(SHORT)
    return path


def cheapest(now, price_kgpj):
    """The usable control of least fuel and priced energy, as an equivalence factor decides."""
    cost_kg = now.fuel_kg + now.switch_fuel_kg + price_kgpj * now.drain_j
    return int(np.argmin(np.where(now.usable, cost_kg, np.inf)))


def priced(now, more=0.0):
    return cheapest(now, PRICE_KGPJ * (1 + more + 10 * (now.soc_end_min - now.soc)))


@policy
def honest(now):
    return priced(now)


@policy
class Remembering:
    """The engine runs on until there is enough."""

    made = 0

    def __init__(self):
        type(self).made += 1
        self.on = False

    def __call__(self, now):
        self.on = now.soc < (0.61 if self.on else 0.59)
        wanted = now.usable & (now.engine_on == self.on)
        cost_kg = now.fuel_kg + PRICE_KGPJ * now.drain_j
        return np.argmin(np.where(wanted if wanted.any() else now.usable, cost_kg, np.inf))


@policy(preview=5)
def looking(now):
    """Charge is worth more before braking is over."""
    next_w = now.ahead.table.signals.wheel_power_w[-1]
    return priced(now, 0.2 if next_w > 0 else -0.2)


@policy
def peeking(now):
    """Finds the table in the frame of whoever asks."""
    table = sys._getframe(1).f_locals["self"].problem.table
    return priced(now, 0.2 if table.battery_power_w[min(now.k + 1, 99)].mean() > 0 else -0.2)


@policy(preview=2)
def peeking_beyond(now):
    table = sys._getframe(1).f_locals["self"].problem.table
    return priced(now, 0.2 if table.battery_power_w[min(now.k + 6, 99)].mean() > 0 else -0.2)


@policy
class Wavering:
    """Decides otherwise from drive to drive."""

    drives = 0

    def __init__(self):
        type(self).drives += 1
        self.more = 0.1 * self.drives

    def __call__(self, now):
        return priced(now, self.more)


@policy(preview=500)
def seeing_all(now):
    return priced(now)


CASES = {
    "honest": (honest, None),
    "remembering": (Remembering, None),
    "looking": (looking, None),
    "peeking": (peeking, r"at step \d+ \(t = \d+ s\) it decides otherwise once what comes after"),
    "peeking beyond": (peeking_beyond, "once what comes after step"),
    "wavering": (Wavering, "it decides otherwise when it is asked the same again"),
    "seeing all": (seeing_all, "its preview of 500 steps shows the whole drive of 100"),
}


@pytest.fixture(scope="module")
def drive(tmp_path_factory):
    path = tmp_path_factory.mktemp("cycle") / "short.csv"
    path.write_text(SHORT)
    return build_problem(load_architecture("C2"), load_cycle(path))


def told(problem, function, name="mine"):
    """What the check says of a strategy's own decisions."""
    solved = brought(name, function).solve
    return solved.why_not_causal(problem, solved(problem).control)


@pytest.mark.parametrize("case", CASES)
def test_what_knows_more_than_it_says_is_caught(drive, case):
    function, said = CASES[case]
    found = told(drive, function)
    assert found is None if said is None else re.search(said, found), found


def test_a_glance_at_one_step_is_caught_wherever_it_matters(drive):
    """Only one decision of the drive depends on the next row."""
    table = drive.table

    @policy
    def glancing(now):
        shown = sys._getframe(1).f_locals["self"].problem.table
        same = (shown.fuel_kg[min(now.k + 1, 99)] == table.fuel_kg[min(now.k + 1, 99)]).all()
        return priced(now, 0.0 if now.k != 70 or same else 9.0)

    assert "at step 70 " in told(drive, glancing)


def test_the_word_of_a_whole_plan_is_checked_too(drive):
    def fussy(problem):
        if problem is not drive:
            raise ValueError("another problem")
        return stepwise(problem, priced)

    assert told(drive, lambda problem: stepwise(problem, priced)) is None
    assert "it decides otherwise once" in told(drive, lambda problem: solve(problem, "ecms"))
    assert "it could not be checked: it fails wherever" in told(drive, fussy)


def test_only_what_passes_the_check_is_marked(short):
    register("its word", lambda problem: solve(problem, "ecms"), causal=True)
    found = compare(short, "C2", ["its word", ("honest", honest), ("peeking", peeking)])
    assert all(row.solved and row.gap_percent >= 0 for row in found.rows)
    assert found.causal == {"honest"}
    assert found.peeking.keys() == {("C2", "its word"), ("C2", "peeking")}
    assert "not causal, C2 peeking: at step 14" in comparison_notes(found)
    assert json.loads(result_json(found, {}))["causal"] == ["honest"]


def test_a_class_is_made_for_every_drive():
    problem = random_problem(4)
    strategy = brought("mine", Remembering)
    before = Remembering.made
    strategy.solve(problem), strategy.solve(problem)
    assert Remembering.made == before + 2 and is_causal(strategy)


def test_what_is_ahead_is_the_problem_from_here():
    problem = random_problem(4)
    seen = []

    @policy(preview=1)
    def watching(now):
        seen.append(now)
        return int(np.flatnonzero(now.usable)[0])

    trajectory = simulate(problem, brought("mine", watching).solve(problem).control)
    steps = len(problem.table.time_s)
    for k, now in enumerate(seen):
        rows = slice(k, min(k + 2, steps))
        ahead = now.ahead
        assert (ahead.table.fuel_kg == problem.table.fuel_kg[rows]).all()
        assert ahead.start_mode == now.mode and ahead.soc_end_min == problem.battery.soc_min
        assert ahead.start_j == pytest.approx(trajectory.energy_j[k], rel=1e-12)
        assert simulate(ahead, trajectory.control[rows]).energy_j[1:] == pytest.approx(
            trajectory.energy_j[k + 1 : rows.stop + 1], rel=1e-12
        )
        drained = now.energy_j - trajectory.energy_j[k + 1]
        assert now.drain_j[trajectory.control[k]] == pytest.approx(drained, abs=1e-6)


def test_what_a_policy_is_shown_has_nothing_behind_it_and_stays_as_it_is():
    problem = random_problem(4)

    @policy
    def trying(now):
        for row in (now.fuel_kg, now.battery_power_w, now.nox_kg, now.switch_fuel_kg, now.drain_j):
            assert row.base is None and not row.flags.writeable
        return int(np.flatnonzero(now.usable)[0])

    brought("mine", trying).solve(problem)


def test_rows_in_their_own_order_are_the_problem():
    problem = random_problem(9)
    steps = np.arange(len(problem.table.time_s))
    same = with_rows(problem, steps)
    for name in ("fuel_kg", "battery_power_w", "reject", "step_s", "switch_fuel_kg"):
        assert (getattr(same.table, name) == getattr(problem.table, name)).all()
    turned = with_rows(problem, steps[::-1])
    assert (turned.table.fuel_kg == problem.table.fuel_kg[::-1]).all()
    assert (turned.table.time_s == problem.table.time_s).all()
    part = rows_ahead(problem, 1, 2, problem.start_j, 0)
    assert part.table.time_s.tolist() == [problem.table.time_s[1]]


@pytest.mark.parametrize("preview", [-1, 0.5, True, "5", 10**6])
def test_a_preview_is_a_number_of_steps(preview):
    with pytest.raises(DataError, match=r"policy: preview = .*; needed: a number of steps"):
        policy(preview=preview)


def test_what_cannot_be_a_policy_is_refused():
    with pytest.raises(DataError, match="policy: a int cannot be marked"):
        policy(5)

    @policy
    class Mute:
        pass

    with pytest.raises(SolverError, match=r"strategy mine: the policy Mute has no __call__\(now\)"):
        brought("mine", Mute).solve(random_problem(4))


def test_a_function_of_a_step_that_declares_nothing_is_told_how():
    with pytest.raises(SolverError, match=r"it was given the whole Problem: @hevopt\.policy marks"):
        brought("mine", lambda now: now.usable).solve(random_problem(4))


def test_a_policy_takes_no_settings_and_can_be_asked_by_another_simulation():
    problem = random_problem(4)
    register("mine", honest)
    with pytest.raises(
        SolverError, match="strategy mine: a policy takes no settings; found horizon"
    ):
        solve(problem, "mine", horizon=3)
    stepper = known.strategy_named("mine").start(problem)
    first = stepper.decide(0, problem.start_j, problem.start_mode)
    assert first == solve(problem, "mine").control[0]
    assert brought("whole", lambda problem: []).start is None


def test_strategies_of_installed_packages_are_known(tmp_path, monkeypatch, capsys, short):
    """Three entry points: one that works, one whose module is not there, one with the name of a shipped one."""
    (tmp_path / "brings.py").write_text(
        "import hevopt, numpy\n@hevopt.policy\ndef mine(now):\n    return numpy.argmax(now.usable)\n"
    )
    about = tmp_path / "brings-1.0.dist-info"
    about.mkdir()
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: brings\nVersion: 1.0\n")
    (about / "entry_points.txt").write_text(
        "[hevopt.strategies]\nfirst = brings:mine\nbroken = no_such_module:f\ndp = brings:mine\n"
    )
    installed.cache_clear()
    monkeypatch.syspath_prepend(tmp_path)
    try:
        found = compare(short, "C2", ["first", "broken"])
        first, broken = found.rows
        assert first.solved and found.causal == {"first"}
        assert "no_such_module" in str(broken.status) and "cannot be imported" in str(broken.status)
        assert known.strategy_named("dp") is known.STRATEGIES["dp"]
        (fault,) = installed(tuple(known.STRATEGIES))[1]
        assert "brings:mine" in fault and "'dp'" in fault
        listed = call(monkeypatch, capsys, "strategies")
        assert "first         brought  from brings:mine" in listed.out
        assert "hevopt: left out: brings:mine: strategy name 'dp': it is taken" in listed.err
    finally:
        sys.modules.pop("brings", None)


def test_a_reference_stands_in_place_of_a_name(tmp_path, monkeypatch, short):
    monkeypatch.chdir(tmp_path)
    text = Path(__file__).read_text()
    body = text[text.index("def cheapest") : text.index("@policy\nclass Remembering")]
    Path("rules.py").write_text(
        f"import numpy as np\nfrom hevopt import policy\nPRICE_KGPJ = {PRICE_KGPJ}\n{body}"
    )
    found = compare(short, "C2", ["rules.py:honest", ("own", honest)])
    assert [row.strategy for row in found.rows] == ["rules.py:honest", "own"]
    assert found.rows[0].fuel_l_per_100km == found.rows[1].fuel_l_per_100km
    assert found.causal == {"rules.py:honest", "own"}
