"""The environment: Gymnasium's checker, returns against the judge and the bound, actions that cannot be used."""

import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from problems import every_plan, random_problem

from hevopt import (
    Battery,
    ControlTable,
    DataError,
    InfeasibleError,
    Problem,
    build_problem,
    certify,
    compare,
    load_architecture,
    load_cycle,
)
from hevopt.gym import OBSERVED, HybridEnv, as_policy

PRICE_KGPJ = 6e-8


@pytest.fixture(scope="module")
def problem():
    return build_problem(load_architecture("C2"), load_cycle("hwfet"))


def flat_battery():
    return Battery([0, 1], [100.0, 100.0], [0.1, 0.1], [0.1, 0.1], 3600.0, 1.0, 0.2, 0.8)


def arrays(power_w, fuel_kg, feasible=None, **more):
    table = ControlTable.from_arrays(fuel_kg, power_w, feasible, **more)
    return Problem(table, flat_battery(), 0.5, 0.5)


def drive(env, choose, **options):
    """Return, infos and last observation of an episode."""
    observation, info = env.reset(seed=3, options=options)
    total, infos, over = 0.0, [], False
    while not over:
        observation, reward, over, cut, info = env.step(choose(observation, info["action_mask"]))
        assert not cut and env.observation_space.contains(observation)
        total += reward
        infos.append(info)
    return total, infos, observation


def at_random(seed):
    rng = np.random.default_rng(seed)
    return lambda observation, mask: int(rng.choice(np.flatnonzero(mask)))


def test_the_checker_of_gymnasium_finds_nothing(problem):
    check_env(HybridEnv(problem), skip_render_check=True)
    check_env(HybridEnv(random_problem(3)), skip_render_check=True)


def test_a_return_is_what_the_judge_adds_up_with_the_end_charge_priced(problem):
    env = HybridEnv(problem)
    for seed in range(2):
        total, infos, _ = drive(env, at_random(seed))
        found = env.trajectory()
        assert [info["control"] for info in infos] == list(found.control)
        assert sum(info["fuel_kg"] for info in infos) == pytest.approx(found.total_fuel_kg, 1e-12)
        surplus_j = found.end_j - problem.end_min_j
        counted = 1.0 if surplus_j > 0 else 2.0
        ending_kg = certify(problem).price_kgpj * surplus_j * counted
        assert total == pytest.approx(-1e3 * (found.cost_kg - ending_kg), rel=1e-12)
        bound_kg, _ = certify(problem).bound_of(found)
        assert bound_kg <= found.cost_kg


@pytest.mark.parametrize("seed", range(40))
def test_no_plan_whatever_its_end_charge_returns_more_than_the_bound(seed):
    problem = random_problem(seed)
    cost_kg, end_j = every_plan(problem)
    if not (end_j >= problem.end_min_j).any():
        with pytest.raises(InfeasibleError, match=r"end charge cannot be reached|step 0"):
            HybridEnv(problem).reset()
        return
    env = HybridEnv(problem)
    env.reset()
    price = env.end_price_kgpj
    assert price >= 0
    surplus_j = end_j - problem.end_min_j
    returns_kg = -(cost_kg - price * surplus_j * np.where(surplus_j > 0, 1.0, 2.0))
    line_kg = max(line.value_kg for lines in certify(problem).proofs.values() for line in lines)
    assert (returns_kg <= -line_kg + 1e-12).all()


def test_what_cannot_be_used_is_replaced_by_the_nearest_that_runs_the_engine_alike(problem):
    power_w = np.array([[-900.0, 0.0, 500.0, 800.0]])
    usable = np.array([[False, True, True, True]])
    one = arrays(power_w, np.full((1, 4), 1e-4), usable, mode=[1, 1, 0, 0])
    turning = np.array([True, True, False, False])
    labels = tuple(
        control._replace(engine_on=bool(on))
        for control, on in zip(one.table.controls, turning, strict=True)
    )
    # Its table entry of 0 W says nothing of the first control's power, so give it one.
    table = replace(one.table, controls=labels, battery_power_w=power_w)
    env = HybridEnv(replace(one, table=table), price_kgpj=PRICE_KGPJ)
    _, infos, _ = drive(env, lambda observation, mask: 0)
    assert infos[0]["control"] == 1 and infos[0]["replaced"]
    _, infos, _ = drive(env, lambda observation, mask: 3)
    assert infos[0]["control"] == 3 and not infos[0]["replaced"]
    # None runs the engine: then the nearest of all.
    off = replace(table, reject=np.array([[1, 1, 0, 0]]))
    env = HybridEnv(replace(one, table=off), price_kgpj=PRICE_KGPJ)
    _, infos, _ = drive(env, lambda observation, mask: 0)
    assert infos[0]["control"] == 2


@pytest.mark.parametrize("action", [-1, 4, 1.5, True, "a", None])
def test_what_is_no_index_is_an_error(action):
    env = HybridEnv(arrays(np.zeros((2, 4)), np.zeros((2, 4))))
    env.reset()
    with pytest.raises(DataError, match="0 to 3"):
        env.step(action)


def test_a_step_without_a_control_ends_the_drive_dearer_than_any_drive():
    # The window holds 1800 J above its lower end: after the second control the next step cannot be driven.
    power_w = np.array([[0.0, 1000.0], [1000.0, 1000.0], [0.0, 0.0]])
    fuel_kg = np.array([[5e-3, 0.0], [1e-3, 1e-3], [1e-3, 1e-3]])
    ohm = np.zeros(2)
    battery = replace(flat_battery(), capacity_as=180.0, discharge_ohm=ohm, charge_ohm=ohm)
    table = ControlTable.from_arrays(fuel_kg, power_w)
    problem = Problem(table, battery, 0.3, 0.3)
    env = HybridEnv(problem, price_kgpj=PRICE_KGPJ)
    good, infos, _ = drive(env, lambda observation, mask: 0)
    assert len(infos) == 3 and env.trajectory().total_fuel_kg == pytest.approx(7e-3)
    bad, infos, last = drive(env, lambda observation, mask: 1)
    assert len(infos) == 1 and not infos[-1]["action_mask"].any() and bad < good
    assert not last[list(OBSERVED).index("fuel_most_g")]
    with pytest.raises(InfeasibleError, match=r"ended at step 1 .*2 before its end"):
        env.trajectory()
    with pytest.raises(DataError, match="reset begins another"):
        env.step(0)


def test_the_seed_draws_among_problems_and_options_name_one(problem):
    other = replace(problem, soc_start=0.55)
    env = HybridEnv(problem, other)
    drawn = [env.reset(seed=seed)[1]["soc"] for seed in range(12)]
    assert drawn == [env.reset(seed=seed)[1]["soc"] for seed in range(12)]
    assert {round(soc, 6) for soc in drawn} == {0.55, round(problem.soc_start, 6)}
    assert env.reset(options={"problem": 1})[1]["soc"] == pytest.approx(0.55)
    assert env.reset(options={"soc_start": 0.65})[1]["soc"] == pytest.approx(0.65)
    for options, words in (
        ({"problem": 2}, "0 to 1"),
        ({"soc": 0.5}, "allowed: problem, soc_start"),
        ({"soc_start": 1.5}, "SOC window"),
        ({"soc_start": "full"}, "soc_start = 'full'"),
        ({"soc_start": None}, "soc_start = None"),
    ):
        with pytest.raises(DataError, match=words):
            env.reset(options=options)


def test_problems_of_other_cars_and_senseless_values_are_refused(problem):
    for make, words in (
        (lambda: HybridEnv(), "no problem"),
        (lambda: HybridEnv(problem, random_problem(0)), "problem 1 has other controls"),
        (lambda: HybridEnv(problem, short=0.5), "allowed: 1 or more"),
        (lambda: HybridEnv(problem, short="much"), "short = 'much'; allowed: 1 or more"),
        (lambda: HybridEnv(problem, short=None), "allowed: 1 or more"),
        (lambda: HybridEnv(problem, price_kgpj=float("nan")), "allowed: 0 or more"),
        (lambda: HybridEnv(problem, price_kgpj="dear"), "price_kgpj = 'dear'; allowed: 0 or more"),
        (lambda: HybridEnv("C2"), "problem 0 is a str; needed: a Problem"),
        (lambda: HybridEnv([problem]), "problem 0 is a list"),
        (lambda: HybridEnv(problem, None), "problem 1 is a NoneType"),
        (lambda: HybridEnv(problem).reset(seed="one"), "seed = 'one'"),
        (lambda: HybridEnv(problem).reset(seed=-1), "0 or more"),
        (
            lambda: HybridEnv(problem).reset(options="problem"),
            "options = 'problem'; needed: a dict",
        ),
    ):
        with pytest.raises(DataError, match=words):
            make()
    with pytest.raises(DataError, match="not over"):
        HybridEnv(problem).trajectory()
    blocked = arrays(np.zeros((1, 2)), np.zeros((1, 2)), np.zeros((1, 2), dtype=bool))
    with pytest.raises(InfeasibleError, match="step 0"):
        HybridEnv(blocked).reset()


def thrifty(observation, mask):
    usable = np.flatnonzero(mask)
    wanted = 40 if observation[0] > observation[1] else 20
    return usable[np.argmin(np.abs(usable - wanted))]


def test_an_agent_stands_in_the_table_as_a_policy_with_the_same_drive(problem):
    found = compare("hwfet", "C2", {"thrifty": as_policy(thrifty), "dp": None})
    rows = {row.strategy: row for row in found.rows}
    assert "thrifty" in found.causal and rows["thrifty"].gap_percent > rows["dp"].gap_percent
    env = HybridEnv(problem)
    drive(env, thrifty)
    assert env.trajectory().soc[-1] == pytest.approx(rows["thrifty"].soc_end, abs=1e-12)


def test_one_message_where_gymnasium_is_not_installed():
    code = "import sys; sys.modules['gymnasium'] = None; import hevopt.gym"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    last = done.stderr.strip().splitlines()[-1]
    assert last.startswith("hevopt.errors.DataError: hevopt.gym needs Gymnasium")
    assert 'pip install "hevopt[gym]"' in last


def test_the_example_learns_and_beats_what_it_started_from(problem, monkeypatch):
    monkeypatch.syspath_prepend(str(Path(__file__).parents[2] / "examples"))
    import learnt

    env, told = HybridEnv(problem), []
    best = learnt.learn(env, 1, rounds=1, drawn=5, said=told.append)
    found = learnt.returns(env, best, 1)
    assert f"round 1: {-found:.1f} g" in told[0]
    guess = learnt.returns(env, learnt.decided(learnt.GUESS, env.end_price_kgpj), 1)
    assert guess < found <= -1e3 * certify(problem).bound_kg(problem.end_min_j)[0]
