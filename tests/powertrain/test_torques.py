"""Speeds and torques of drawn drivelines: Willis, balance of every shaft, and power, at drawn points.

`python tests/powertrain/test_torques.py 10000` draws as many.
"""

import sys

import numpy as np
import pytest

from hevopt import DataError
from hevopt.car.balance import joints_of, speeds_of
from hevopt.car.driveline import BRAKE, ENGINE, Driveline, Phase, State
from hevopt.car.parts import WHEEL, Gear, Planetary
from hevopt.car.ways import way
from hevopt.powertrain.shafts import Shafts
from hevopt.powertrain.torques import Torques

DRAWS = 300


def drawn_line(rng):
    """A driveline of gears and up to two planetary sets, engine and machines somewhere on it."""
    parts, shafts = [], [WHEEL]
    for n in range(rng.integers(1, 6)):
        eta = rng.choice([1.0, rng.uniform(0.7, 0.99)])
        if rng.random() < 0.35 and sum(isinstance(p, Planetary) for p in parts) < 2:
            old = str(rng.choice(shafts))
            places = [old, f"s{n}a", f"s{n}b"]
            rng.shuffle(places)
            parts.append(Planetary(f"planetary {n}", *places, rng.uniform(1.4, 4.0), eta))
            shafts += [f"s{n}a", f"s{n}b"]
        else:
            old = str(rng.choice(shafts))
            new = f"s{n}"
            pair = (new, old) if rng.random() < 0.5 else (old, new)
            parts.append(Gear(f"gear {n}", *pair, rng.uniform(0.3, 8.0), eta))
            shafts.append(new)
    engine = str(rng.choice(shafts[1:]))
    machines = [(f"m{n}", str(rng.choice(shafts))) for n in range(rng.integers(1, 4))]
    return Driveline("parts", tuple(parts), engine, tuple(machines), free_engine_speed=True)


def drawn_point(rng, line):
    """A way of the line with speeds, and torques given; None where it has none."""
    try:
        found = way(line, State(bool(rng.random() < 0.7)), Phase(standing=False))
    except DataError:
        return None
    inputs = {WHEEL: rng.uniform(1, 120)} | dict.fromkeys(found.held, rng.uniform(0, 400))
    speeds = {
        shaft: sum(np.asarray(c) * inputs[name] for name, c in terms.items()) + np.zeros(1)
        for shaft, terms in speeds_of(found).items()
    }
    acting = {shaft: rng.normal(0, 50, 1) for shaft in found.shafts}
    shafts = Shafts(
        np.zeros(1, int),
        np.zeros(1, int),
        speeds,
        speeds,
        acting,
        (None, None),
        acting[WHEEL],
        np.zeros(1),
        np.zeros(1),
    )
    given = {name: rng.normal(0, 100, (1, 7)) for name in found.chosen}
    if found.slack is not None:
        given[BRAKE] = np.zeros((1, 1))
    return found, shafts, given


def check(rng) -> int:
    """Hold one drawn point against the equations, each written out anew; how many torques were compared."""
    point = drawn_point(rng, drawn_line(rng))
    if point is None:
        return 0
    found, shafts, given = point
    w = {shaft: float(v[0]) for shaft, v in shafts.speed_radps.items()}
    names = [joint.name for joint in joints_of(found)]
    actuators = [name for name in (*found.active, BRAKE) if name not in given]
    torques = given | Torques(found, shafts).solve(given, [*names, *actuators])
    torques = {name: np.broadcast_to(t, (1, 7))[0] for name, t in torques.items()}
    assert not np.isnan(np.concatenate(list(torques.values()))).any()
    on = {shaft: np.full(7, -float(v[0])) for shaft, v in shafts.acting_nm.items()}
    for name, shaft in (*found.active.items(), (BRAKE, WHEEL)):
        on[shaft] = on[shaft] + torques[name]
    lost = np.zeros(7)
    for use in found.uses:
        part, lam = use.part, torques[use.part.name]
        if isinstance(part, Gear):
            assert w[part.first] == pytest.approx(part.ratio * w[part.second], abs=1e-9)
            entering = lam * w[part.first]
            h = np.where(entering >= 0, part.efficiency, 1 / part.efficiency)
            on[part.first] -= lam
            on[part.second] += part.ratio * h * lam
        else:
            k, eta = part.ratio, part.efficiency
            willis = w[part.sun] + k * w[part.ring] - (1 + k) * w[part.carrier]
            assert abs(willis) < 1e-9
            entering = lam * (w[part.sun] - w[part.carrier])
            h = np.where(entering >= 0, eta, 1 / eta)
            on[part.sun] -= lam
            on[part.ring] -= k * h * lam
            on[part.carrier] += (1 + k * h) * lam
        lost += entering * (1 - h)
        assert (entering * (1 - h) >= -1e-6).all()
    scale = 1 + max(np.abs(t).max() for t in torques.values())
    for shaft, sum_nm in on.items():
        assert np.abs(sum_nm).max() < 1e-9 * scale, shaft
    placed = (*found.active.items(), (BRAKE, WHEEL))
    given_w = sum(torques[name] * w[shaft] for name, shaft in placed)
    taken_w = sum(float(v[0]) * w[shaft] for shaft, v in shafts.acting_nm.items())
    assert np.abs(given_w - taken_w - lost).max() < 1e-9 * scale * (1 + max(map(abs, w.values())))
    return 7 * len(torques)


def test_every_drawn_point_keeps_willis_balance_and_power():
    rng = np.random.default_rng(3)
    assert sum(check(rng) for _ in range(DRAWS)) > 5 * DRAWS
    assert ENGINE != BRAKE


if __name__ == "__main__":
    generator = np.random.default_rng(4)
    compared = [check(generator) for _ in range(int(sys.argv[1]))]
    print(f"{np.count_nonzero(compared)} of {len(compared)} drawn drivelines could be driven")
