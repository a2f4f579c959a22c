"""A car of one gear by hand, and runs of the compiled step in plain Python."""

from math import inf, nan

import numpy as np

from hevopt.car.handling import Clutch, Tyre
from hevopt.forward._contact_kernels import Body, pace_of
from hevopt.forward._plant_kernels import Outputs, step
from hevopt.forward._rows_kernels import Inputs, State, Ways, settled_rows

RADIUS_M, RATIO, IDLE_RADPS, ENGINE_KGM2 = 0.3132, 13.8244, 850 * np.pi / 30, 0.18


def body(rolling_n=(0.0,) * 4, air_n=(0.0,) * 4, lag_s=0.0, mass_kg=1300.0, **tyre):
    """1300 kg without resistance, unless some is given."""
    return Body(mass_kg, mass_kg + 28.0, RADIUS_M, rolling_n, air_n, Tyre(lag_s, **tyre), Clutch())


def one_gear(efficiency=1.0, engine_kgm2=ENGINE_KGM2, machine_kgm2=None):
    """Engine, clutch and one gear; a machine on the gear's input where it has an inertia."""
    machine = machine_kgm2 is not None
    wheel = [0.0, RATIO, RATIO] if machine else [0.0, RATIO]
    side = [1.0, 0.0, 0.0] if machine else [1.0, 0.0]
    load = [0.0, 1.0, 1.0] if machine else [0.0, 1.0]
    inertia = [engine_kgm2, *([machine_kgm2] if machine else []), 0.0]
    shape = (1, 2, len(wheel))
    yields = np.ones(shape)
    yields[0, 0, 1:], yields[0, 1, 1:] = efficiency, 1 / efficiency
    return Ways(
        np.array([wheel]), np.array([side]), yields, np.ones(shape),
        np.broadcast_to(load, (1, 2, 1, len(load))).copy(), np.array([[[RATIO, 0.0]]]),
        np.array([[efficiency]]), np.array(inertia),
    )  # fmt: skip


def inputs(**given):
    """Nothing acts but what is given."""
    usual = Inputs(np.zeros(0), 0.0, -1.0, -inf, inf, 0.0, 0.0, 0.0, 0, 0, 0.0)
    return usual._replace(**given)


def run(car, ways, state, acting, step_s, steps):
    """(state, ...) from the first on, and (outputs, ...) of every step; acting: (time, state) -> Inputs."""
    pace, rows = pace_of(step_s, car.tyre.lag_s), settled_rows(ways)
    scratch = np.full(rows.shape[2], nan)
    states, found = [state], []
    for k in range(steps):
        after, out = step(
            car, ways, rows, states[-1], acting(k * step_s, states[-1]), pace, scratch
        )
        states.append(State(*after))
        found.append(Outputs(*out))
    return states, found


def standing(speed_mps=0.0, side_radps=IDLE_RADPS):
    """A car at a speed, its engine idling."""
    return State(speed_mps, 0.0, side_radps, 0, 0, 0.0, 0)
