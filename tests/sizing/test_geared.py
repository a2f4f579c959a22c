"""The proof over final drives: laws of a range nowhere above those of any car inside, and none below its bound."""

from dataclasses import replace

import numpy as np
import pytest

from hevopt import load_architecture, simulate, solve
from hevopt.driving.demand import demand_of
from hevopt.driving.driver import gap_shares, launch_speed_radps, launches_at_idle, least_gap_shares
from hevopt.powertrain.branches import branches
from hevopt.powertrain.powertrain import build_problem
from hevopt.sizing.proof.bundle import planes_of
from hevopt.sizing.proof.entries import Box, Touch, impossible, prices_of
from hevopt.sizing.proof.laws import laws_of
from hevopt.sizing.proof.modes import NotProvable
from hevopt.sizing.proof.prove import _Proof, prove
from hevopt.sizing.proof.space import DRIVE, Space

SIZES = {
    "engine.scale.displacement": (0.8, 1.2),
    "machine.scale.power": (0.6, 1.6),
    "battery.cells_in_series": (40, 120),
}
PIECES = ((2.8, 2.9), (3.1, 3.13), (3.4, 3.9))
ON, OFF = slice(0, -1), -1


@pytest.fixture(scope="module")
def proof(urban):
    return _Proof(Space("C2", SIZES | {DRIVE: (2.8, 4.0)}, {}), urban)


def boxed(proof, drive):
    return replace(proof.space.root, drive=drive)


def point(proof, cycle, ratio):
    """The laws of one final drive."""
    space = Space("C2", SIZES, {DRIVE: ratio})
    return laws_of(space.corners(), [space.base], cycle, space.low, space.high)


def touched(proof, laws, theta, scale, jump=1.0):
    after = proof.shapes[-1] * proof.scale * scale
    after[: len(after) // 2] *= jump
    prices = prices_of(after)
    return Touch(laws, proof.cell, theta, prices).entries(), prices


def worst(proof, cycle, laws, drive, rng):
    """By how much planes and switching of a piece lie above the exact minima of a car inside, at most."""
    low, high = proof.space.low, proof.space.high
    centre, other = low + (high - low) * rng.random((2, 3))
    ratio = rng.choice([*drive, rng.uniform(*drive)])
    scale, jump = rng.uniform(0.8, 1.2, 2)
    exact_laws = point(proof, cycle, ratio)
    planes, prices = touched(proof, laws, centre, scale, jump)
    exact, _ = touched(proof, exact_laws, other, scale, jump)
    at = np.append(1.0, other)
    barred = impossible(laws, boxed(proof, drive))
    barred_exact = impossible(exact_laws, Box(other, other))
    value = np.where(barred, np.inf, planes @ at)
    true = np.where(barred_exact, np.inf, exact @ at)
    pairs = [(value[ON].min(axis=0), true[ON].min(axis=0)), (value[OFF], true[OFF])]
    above = [(v[np.isfinite(t)] - t[np.isfinite(t)]).max() for v, t in pairs]
    switch, real = (
        planes_of(of, proof.cell, entries, prices, 1.0).switch @ at
        for of, entries in ((laws, planes), (exact_laws, exact))
    )
    return max(*above, (switch - real).max())


@pytest.mark.parametrize("drive", PIECES)
def test_exact_minima_of_cars_inside_lie_nowhere_below_the_laws_of_a_piece(proof, urban, drive):
    laws, rng = proof.laws_of(boxed(proof, drive)), np.random.default_rng(11)
    assert len(laws.on) == 1 + laws.apart.any()
    assert max(worst(proof, urban, laws, drive, rng) for _ in range(4)) <= 1e-12


def test_a_wide_piece_has_steps_with_either_clutch(proof):
    assert proof.laws_of(boxed(proof, PIECES[2])).apart.sum() > 0


def planted(laws, fault):
    """The laws of a piece with a fault."""
    on, off = laws.on[0], laws.off
    found = {
        "friction": lambda: replace(laws, on=(replace(on, friction=1.02 * on.friction), *laws.on[1:])),
        "other clutch": lambda: replace(laws, on=laws.on[:1]),
        "switching": lambda: replace(laws, switch_j=laws.switch_j + 0.05 * np.abs(laws.switch_j)),
        "inertia": lambda: replace(laws, off=replace(off, inertia=off.inertia + 0.05 * np.abs(off.inertia))),
        "static": lambda: replace(laws, off=replace(off, static=1.05 * off.static)),
        "wheels": lambda: replace(laws, off=replace(off, driving=1.01 * off.driving)),
    }  # fmt: skip
    return found[fault]()


@pytest.mark.parametrize(
    "fault", ["friction", "other clutch", "switching", "inertia", "static", "wheels"]
)
def test_a_planted_fault_is_seen_by_exact_minima(proof, urban, fault):
    drive = PIECES[2] if fault == "other clutch" else PIECES[1]
    wrong, rng = planted(proof.laws_of(boxed(proof, drive)), fault), np.random.default_rng(12)
    assert max(worst(proof, urban, wrong, drive, rng) for _ in range(3)) > 1e-9


def test_no_control_of_a_real_table_lies_below_the_laws_of_a_piece(proof, urban):
    rng, drive, cell = np.random.default_rng(13), PIECES[2], proof.cell
    laws, box = proof.laws_of(boxed(proof, drive)), boxed(proof, drive)
    barred = impossible(laws, box)
    planes, prices = touched(proof, laws, np.array([1.0, 1.1, 1.25]), 1.05)
    for ratio in (*drive, rng.uniform(*drive), rng.uniform(*drive)):
        theta = box.low + (box.high - box.low) * rng.random(3)
        theta[2] = round(64 * theta[2]) / 64
        car = proof.space.car(theta, ratio)
        for branch in branches(car, demand_of(urban, car.vehicle, car.gearbox), 9, None):
            places = ON if branch.driven.state.engine_on else slice(-1, None)
            below = np.where(barred[places], np.inf, planes[places] @ np.append(1.0, theta)).min(
                axis=0
            )
            exact = cost_of(laws, cell, prices, theta[2], branch)
            assert np.where(branch.reject == 0, below[:, None] - exact, -1.0).max() <= 1e-12


def cost_of(laws, cell, prices, batteries, branch):
    """(time, level) what controls cost under prices: least over a fine grid of stored energy."""
    b = (branch.battery_power_w / batteries)[..., None]
    x = np.linspace(cell.low, cell.high, 41)
    squared = cell.low_v2 + cell.slope * (x - cell.low)
    root = np.sqrt(np.maximum(squared * (squared - 4 * cell.discharge_ohm * b), 0.0))
    drain = (squared - root) / (2 * cell.discharge_ohm) * np.where(b < 0, cell.efficiency, 1.0)
    worth = (laws.step_s * prices.after)[:, None, None] * drain + prices.tilt[:, None, None] * x
    return branch.fuel_kg + batteries * worth.min(axis=-1)


def litres_of(space, cycle, theta, ratio, name):
    problem = build_problem(space.car(theta, ratio), cycle)
    return simulate(problem, solve(problem, name).control).cost_kg / 0.835 / cycle.distance_m * 1e5


def test_branching_over_the_final_drive_closes_and_no_design_inside_lies_below(urban):
    ranges = {DRIVE: (3.2, 3.5), "machine.scale.power": (0.8, 1.4)}
    found = prove("C2", ranges, urban, target_gap=0.009)
    assert found.closed and 0 < found.gap <= 0.009 and found.boxes > 3
    assert 3.2 <= found.best[DRIVE] <= 3.5
    space, rng = Space("C2", ranges, {}), np.random.default_rng(14)
    for ratio in (3.2, 3.5, *rng.uniform(3.2, 3.5, 2)):
        theta = space.low + (space.high - space.low) * rng.random(3)
        assert litres_of(space, urban, theta, ratio, "dp") >= found.bound_l_per_100km
    best = load_architecture("C2", dict(found.best))
    plan = solve(build_problem(best, urban), "dp")
    litres = (
        simulate(build_problem(best, urban), plan.control).cost_kg / 0.835 / urban.distance_m * 1e5
    )
    assert litres == pytest.approx(found.best_l_per_100km, rel=1e-9)


def test_a_gap_that_boxes_do_not_close_is_left_and_told(urban):
    found = prove("C2", {DRIVE: (3.2, 3.25)}, urban, target_gap=1e-4, boxes_max=3)
    assert not found.closed and found.gap > 1e-4 and found.boxes == 3


def test_between_two_final_drives_gaps_are_no_longer_and_launches_at_idle(urban):
    def car(ratio):
        return load_architecture("C2", {DRIVE: ratio, "gearbox.shift_gap_s": 0.4})

    low, high = car(2.8), car(4.0)
    vehicle, engine = low.vehicle, low.engine
    demand = demand_of(urban, vehicle, low.gearbox)
    least = least_gap_shares(demand, vehicle, engine, low.gearbox, high.gearbox)
    idle = launches_at_idle(demand, engine, low.gearbox, high.gearbox)
    assert least.max() > 0 and idle.any()
    for ratio in np.linspace(2.8, 4.0, 9):
        box = car(ratio).gearbox
        assert (least <= gap_shares(demand, vehicle, engine, box)).all()
        assert (launch_speed_radps(demand, engine, box)[idle] == engine.idle_radps).all()
    hard = replace(demand, wheel_torque_nm=6 * demand.wheel_torque_nm)
    late = ~launches_at_idle(hard, engine, low.gearbox, high.gearbox)
    assert (launch_speed_radps(hard, engine, low.gearbox)[late] > engine.idle_radps).any()


def test_a_load_that_is_less_with_the_engine_at_rest_counts_there(urban):
    lazy = load_architecture("C2")
    less = replace(lazy, vehicle=replace(lazy.vehicle, auxiliary_off_power_w=50.0))
    for car in (lazy, less):
        laws = laws_of(
            {corner: car for corner in Space("C2", {}, {}).corners()},
            [car],
            urban,
            np.ones(3),
            np.ones(3),
        )
        moving = laws.off.w > 0
        assert set(laws.off.load[moving]) == {car.vehicle.load_w(engine_on=False)}
        assert set(laws.on[0].load[moving]) == {car.vehicle.auxiliary_power_w}


def test_launches_above_idle_speed_are_no_range(urban):
    fixed = {"engine.scale.displacement": 0.25}
    with pytest.raises(NotProvable, match="launches above idle speed"):
        prove("C2", {DRIVE: (2.8, 4.0)}, urban, fixed=fixed)


@pytest.mark.long
def test_of_a_thousand_random_designs_with_any_final_drive_none_lies_below(urban):
    ranges = SIZES | {DRIVE: (2.8, 4.0)}
    found = prove("C2", ranges, urban)
    space, rng, near = Space("C2", ranges, {}), np.random.default_rng(15), 0
    for theta in space.low + (space.high - space.low) * rng.random((1000, 3)):
        ratio = rng.uniform(2.8, 4.0)
        litres = litres_of(space, urban, theta, ratio, "ecms")
        if litres <= 1.02 * found.bound_l_per_100km:
            near += 1
            litres = min(litres, litres_of(space, urban, theta, ratio, "dp"))
        assert litres >= found.bound_l_per_100km, (theta, ratio)
    assert near > 0
