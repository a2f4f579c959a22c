"""Road load from coast-downs: C0, C1, C2 of equation (12) from speed over time, runs in both directions.

With direction d = +1 or -1, slope force s and wind w along the track, a coasting car of mass m (rotating parts
included) obeys
    m dv/dt = -F,  F = C0 + d s + C1 v + C2 (v + d w)² = (c + d s) + (C1 + d e) v + C2 v²,
    c = C0 + C2 w²,  e = 2 C2 w.
1. Each run by itself: the closed solution v(t) for a quadratic F, fitted to all its samples by least squares.
2. The runs of each direction: F of each run at whole m/s within its own speeds, fitted by a quadratic in v by
   least squares. The mean of the two directions' coefficients is c, C1, C2, half their difference is s and e;
   c - e²/(4 C2) takes out of C0 what a wind leaves there even after averaging.
(One fit of v(t) to all runs would be biased: runs that happen to roll longer would weigh more.)

Samples of one run are not independent of each other: gusts and the state of the road last. Intervals therefore
come from the scatter of whole runs, by the jackknife (every run left out once, within its direction) and
Student's t with the degrees of freedom of Welch and Satterthwaite, as the directions may scatter unequally.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hevopt.display.facts import Shown
from hevopt.errors import DataError, SolverError

Array = NDArray[np.float64]

CONFIDENCE = 0.95
_COMPLEX_STEP = 1e-30
_SERIES_BELOW = 1e-8
_RUNS_MIN = 2


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Run(Shown):
    """One coast-down. direction: +1 or -1; time_s, speed_mps: (sample,); place: where it was read from."""

    label: str
    direction: int
    time_s: Array
    speed_mps: Array
    place: str


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class RoadLoad(Shown):
    """A fit. coefficients: (3,) C0 (N), C1 (N s/m), C2 (N s²/m²).

    covariances: (direction, 3, 3) what the scatter of either direction's runs adds; freedom: (direction,) of each
    slope_n: force by the slope, wind_mps: head wind, both in direction +1; None where C2 does not stand out
    speeds_mps: per run (sample,) the speed by these; offset_n: (run,) mean force of a run beyond the fit's
    condition: condition number of the second fit's columns 1, v, v², each of unit length
    """

    coefficients: Array
    covariances: Array
    freedom: Array
    slope_n: float
    wind_mps: float | None
    speeds_mps: tuple[Array, ...]
    offset_n: Array
    condition: float

    def half_width(self) -> Array:
        """(3,) half of the 95 % confidence interval of each coefficient."""
        return self._half_width(np.eye(3))

    def force_n(self, speed_mps: Array) -> tuple[Array, Array]:
        """(speed,) resistance, and half of its 95 % confidence interval."""
        powers = np.stack([np.ones_like(speed_mps), speed_mps, speed_mps**2], axis=-1)
        return powers @ self.coefficients, self._half_width(powers)

    def _half_width(self, weights: Array) -> Array:
        """(row,) of sums of the coefficients, weighted by (row, 3)."""
        from scipy.stats import t

        parts = np.einsum("ki,dij,kj->kd", weights, self.covariances, weights)
        variance = np.maximum(parts.sum(axis=1), np.finfo(float).tiny)
        shares = ((parts / variance[:, None]) ** 2 / self.freedom).sum(axis=1)
        freedom = 1 / np.maximum(shares, 1e-6)
        return t.ppf((1 + CONFIDENCE) / 2, freedom) * np.sqrt(variance)


def fit_road_load(runs: list[Run], mass_kg: float) -> RoadLoad:
    """C0, C1, C2 with their covariance; mass_kg: with what the rotating parts add.

    Raises DataError with fewer than two runs in either direction, SolverError where a run has no fit.
    """
    for direction in (1, -1):
        found = sum(run.direction == direction for run in runs)
        if found < _RUNS_MIN:
            raise DataError(
                f"{found} runs in direction {direction:+d}; needed: {_RUNS_MIN} or more in each of two "
                "directions, since slope and wind cancel between them and the intervals come from the "
                "scatter of runs; add runs"
            )
    own = [_fit_run(run, mass_kg) for run in runs]
    rows = [_rows(run, *fit) for run, fit in zip(runs, own, strict=True)]
    columns, forces = np.vstack([r for r, _ in rows]), np.concatenate([f for _, f in rows])
    common = np.linalg.lstsq(columns, forces)[0]
    covariances = _jackknife(runs, rows, common)
    return _road_load(runs, mass_kg, common, covariances, own, rows)


def speed_after(time_s: Array, start_mps: complex, force: Array, mass_kg: float) -> Array:
    """Speed of a coasting car: exact solution of m dv/dt = -(a + b v + c v²) for force (a, b, c).

    v = x/y turns the equation into a linear one, whose matrix squares to -z times the identity.
    """
    a, b, c = force / mass_kg
    z = a * c - b**2 / 4
    root, small = np.sqrt(complex(z)), np.abs(z) * time_s**2 < _SERIES_BELOW
    # For z < 0 these are the hyperbolic functions; the series joins the two at 0.
    cosine = np.cos(root * time_s)
    sine = np.where(small, time_s * (1 - z * time_s**2 / 6), np.sin(root * time_s) / (root or 1.0))
    above = start_mps * (cosine - b / 2 * sine) - a * sine
    return above / (cosine + b / 2 * sine + c * start_mps * sine)


def _fit_run(run: Run, mass_kg: float) -> tuple[Array, float]:
    """(3,) force coefficients of one run, and its start speed."""
    from scipy.optimize import least_squares

    t, v = run.time_s - run.time_s[0], run.speed_mps
    # First guess: m (v_0 - v) is the integral of the force, linear in its coefficients.
    rows = np.column_stack([t, _integral(t, v), _integral(t, v**2)])
    guess = np.linalg.lstsq(rows, mass_kg * (v[0] - v))[0]

    def fitted(x: Array) -> Array:
        with np.errstate(all="ignore"):
            return np.nan_to_num(speed_after(t, x[3], x[:3], mass_kg), nan=1e6, posinf=1e6)

    def jacobian(x: Array) -> Array:
        moved = x + 1j * _COMPLEX_STEP * np.eye(4)
        return np.column_stack([fitted(row).imag for row in moved]) / _COMPLEX_STEP

    found = least_squares(
        lambda x: fitted(x).real - v, [*guess, v[0]], jac=jacobian, x_scale="jac", xtol=1e-12
    )
    if not found.success:
        raise SolverError(f"{run.place}: run {run.label} has no fit; cut or delete the run")
    return found.x[:3], float(found.x[3])


def _integral(t: Array, f: Array) -> Array:
    return np.concatenate([[0.0], np.cumsum(np.diff(t) * (f[1:] + f[:-1]) / 2)])


def _rows(run: Run, force: Array, start_mps: float) -> tuple[Array, Array]:
    """(speed, 6) columns and (speed,) forces of a run, at whole m/s within its own speeds.

    The columns belong to the mean of the two directions' three coefficients, then to half their difference.
    """
    low, high = run.speed_mps.min(), max(run.speed_mps.max(), start_mps)
    v = np.arange(np.ceil(low), np.floor(high) + 1)
    if len(v) < 3:
        v = np.linspace(low, high, 3)
    powers = np.column_stack([np.ones_like(v), v, v**2])
    return np.hstack([powers, run.direction * powers]), powers @ force


def _jackknife(runs: list[Run], rows: list[tuple[Array, Array]], common: Array) -> Array:
    """(direction, 6, 6) parts of the covariance: each run left out once, the runs of a direction as one stratum."""
    information = np.array([columns.T @ columns for columns, _ in rows])
    scores = np.array([columns.T @ (force - columns @ common) for columns, force in rows])
    changes = -np.linalg.solve(information.sum(axis=0) - information, scores[..., None])[..., 0]
    directions = np.array([run.direction for run in runs])
    parts = []
    for direction in (1, -1):
        of_these = changes[directions == direction]
        n, away = len(of_these), of_these - of_these.mean(axis=0)
        parts.append((n - 1) / n * away.T @ away)
    return np.array(parts)


def _road_load(
    runs: list[Run],
    mass_kg: float,
    common: Array,
    covariances: Array,
    own: list[tuple[Array, float]],
    rows: list[tuple[Array, Array]],
) -> RoadLoad:
    c, c1, c2, s, e, _ = common
    # Where C2 is not clearly above 0, a wind cannot be told from the data.
    variance = np.diag(covariances.sum(axis=0))
    windy = c2 > 2 * np.sqrt(variance[2])
    to_coefficients = np.eye(3, 6)
    if windy:
        c = c - (e**2 - variance[4]) / (4 * c2)
        to_coefficients[0, 2], to_coefficients[0, 4] = (e / (2 * c2)) ** 2, -e / (2 * c2)
    powers = np.vstack([columns[:, :3] for columns, _ in rows])
    return RoadLoad(
        coefficients=np.array([c, c1, c2]),
        covariances=to_coefficients @ covariances @ to_coefficients.T,
        freedom=np.array([sum(run.direction == d for run in runs) - 1 for d in (1, -1)]),
        slope_n=s,
        wind_mps=e / (2 * c2) if windy else None,
        speeds_mps=tuple(
            speed_after(
                run.time_s - run.time_s[0],
                start,
                common[:3] + run.direction * common[3:],
                mass_kg,
            ).real
            for run, (_, start) in zip(runs, own, strict=True)
        ),
        offset_n=np.array([(force - columns @ common).mean() for columns, force in rows]),
        condition=float(np.linalg.cond(powers / np.linalg.norm(powers, axis=0))),
    )
