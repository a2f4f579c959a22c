"""Bounds on all that lies between levels, against finer tables of the same laws, every plan of which is tried.

Cost over battery power is convex, drawn with kinks, flat and steep parts; a coarse table says so, and must not be
proven to cost more than any plan of one with more controls between.
"""

import numpy as np
from proofs.draw import draw
from proofs.exact import every_plan

from hevopt import ControlTable, InfeasibleError, Problem, certify, simulate
from hevopt.bounds import certificate as certificate_module
from hevopt.bounds.claim import Scope
from hevopt.strategies import dp


def drawn(seed: int) -> tuple[Problem, Problem]:
    """A problem of three controls per mode that is declared convex, and one with more controls between."""
    base, rng = draw(seed), np.random.default_rng([13, seed])
    steps, modes = min(len(base.table.step_s), 3), int(rng.integers(1, 3))
    reach = max(np.abs(base.table.battery_power_w).max() * rng.uniform(0.2, 1.0), 1e-12)
    shape = (steps, modes, 5)
    power = np.sort(rng.uniform(-1, 1, shape), axis=-1)
    power += np.linspace(0, 0.2, 5)
    unit = float(np.abs(base.table.fuel_kg).max()) or 1.0
    fuel = _convex(rng, power, (steps, modes, 1)) * unit
    nox = _convex(rng, power, (steps, modes, 1)) * unit * 0.01
    coarse = np.array([0, 2, 4]) if rng.random() < 0.5 else np.array([0, 1, 4])
    switch = base.table.switch_fuel_kg[..., :1, :1] * (1 - np.eye(modes))

    def problem(which, between, usable=None):
        flat = (steps, modes * len(which))
        table = ControlTable.from_arrays(
            fuel[..., which].reshape(flat),
            (power[..., which] * reach).reshape(flat),
            None if usable is None else usable.reshape(flat),
            step_s=base.table.step_s[:steps],
            nox_kg=nox[..., which].reshape(flat),
            mode=np.repeat(np.arange(modes), len(which)),
            switch_fuel_kg=switch[:steps] if switch.ndim == 3 else switch,
            between=between,
        )
        return Problem(table, base.battery, base.soc_start, base.soc_end_min, 0, base.nox_weight)

    one = problem(coarse, "convex")
    # What the battery refuses of the coarse table ends what is spoken of.
    open_ = one.table.feasible.reshape(steps, modes, 3)
    low = np.where(open_, power[..., coarse], np.inf).min(axis=-1, keepdims=True)
    high = np.where(open_, power[..., coarse], -np.inf).max(axis=-1, keepdims=True)
    return one, problem(np.arange(5), "", (power >= low) & (power <= high))


def _convex(rng, power, shape):
    kind = rng.integers(0, 3)
    if kind == 0:
        return (power - rng.uniform(-1, 2, shape)) ** 2
    kink, left, right = rng.uniform(-1, 1, shape), *np.sort(rng.uniform(-2, 1, (2, *shape)), axis=0)
    lines = np.where(power < kink, left * (power - kink), right * (power - kink)) + 2
    return lines if kind == 1 else np.maximum(lines, 2 - power) + 0.1 * power**2


def split_faults(seed: int) -> list[str]:
    """What is wrong with the bounds of a drawn problem; [] where none lies above a plan of the finer table."""
    coarse, fine = drawn(seed)
    plans = every_plan(fine)
    try:
        rollout = simulate(coarse, dp.solve(coarse, nodes=301).control)
        found = [certify(coarse)]
        nodes = certificate_module.LOWER_DP_NODES
        certificate_module.LOWER_DP_NODES = ()
        try:
            found.append(certify(coarse, rollout, target_gap=0.0))
        finally:
            certificate_module.LOWER_DP_NODES = nodes
    except InfeasibleError:
        return []
    if any(certificate.scope is not Scope.CONTINUOUS for certificate in found):
        return ["scope is not continuous"]
    faults = []
    for certificate in found:
        over, cost = max(
            ((certificate.bound_kg(end)[0] - cost, cost) for cost, end, _ in plans),
            default=(-1.0, 0.0),
        )
        if over > 1e-12 * abs(cost):
            faults.append(f"bound {over:.3g} kg above a plan of {cost:.9g} kg between levels")
    return faults
