"""The published figures, beside which ours are shown; nothing is tuned towards them.

Source: F. Millo, L. Rolando, M. Andreata, Numerical Simulation for Vehicle Powertrain Development, in Numerical
Analysis - Theory and Application (2011), section 4.2: NEDC, warm, change against A, as the text gives them.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import NamedTuple

from hevopt.architecture import Architecture, load_architecture
from hevopt.cycle import Cycle, load_cycle
from hevopt.provenance import cycle_contents
from hevopt.study import Comparison

# What the published changes are measured on and against.
CYCLE, REFERENCE = "nedc", "A baseline"
# Published about the energy at the wheels, NEDC.
WHEEL_WORK_MJPKM = 0.4
HYBRIDS = ("C1", "C2", "D", "E")
CARS = ("A", "B", *HYBRIDS)
_BASE = ("A", "baseline")
_WHOLE, _ABOUT = 0.5, 1.0


class Figures(NamedTuple):
    """What a row emits and burns; fuel charge-corrected."""

    fuel_l_per_100km: float
    nox_mg_per_km: float


Cases = Mapping[tuple[str, str], Figures]


class Statement(NamedTuple):
    """One published statement, from `low` to `high` per cent, and how ours is measured.

    rounding: half of what its last digit says, or a whole per cent where the text says "about"
    cars: those that it speaks of; differs: in a few words, why ours is another
    """

    what: str
    published: str
    low: float
    high: float
    rounding: float
    cars: tuple[str, ...]
    ours: Callable[[Cases], float]
    differs: str


class Published(NamedTuple):
    """One statement: what is compared, the published value, ours, and what differs."""

    what: str
    published: str
    ours: str
    differs: str


def percent(value: float, base: float) -> float:
    """Change against a base."""
    return 100 * (value / base - 1)


def fuel_change(car: str, strategy: str) -> Callable[[Cases], float]:
    """Measures the fuel of a case against A's, per cent."""
    return lambda cases: percent(cases[car, strategy][0], cases[_BASE][0])


def nox_change(car: str, strategy: str) -> Callable[[Cases], float]:
    """Measures the NOx of a case against A's, per cent."""
    return lambda cases: percent(cases[car, strategy][1], cases[_BASE][1])


def cut_over_conventional(car: str, figure: int) -> Callable[[Cases], float]:
    """Measures what nox_cut changes against conventional on a car, per cent; figure 0: fuel, 1: NOx."""
    return lambda cases: percent(cases[car, "nox_cut"][figure], cases[car, "conventional"][figure])


def _mean_nox(cases: Cases, cars: Sequence[str] = HYBRIDS) -> float:
    changes = [nox_change(car, "conventional")(cases) for car in cars]
    return sum(changes) / len(changes)


_ENGAGED = "ours keeps the engine on in every K phase; without that it is close"
_OPEN = "ours has no speed threshold and brakes with the machine alone: hevopt reproduction"
_IDLE = "NOx of the map at idle, engine on in the K phases: hevopt reproduction"
_MAP = "NOx map, and thresholds calibrated for fuel alone: hevopt reproduction"
_SEVERE = "ours takes the family's least NOx, whatever it costs in fuel"
_UNEXPLAINED = "not explained: hevopt reproduction"
STATEMENTS: tuple[Statement, ...] = (
    Statement(
        "B start_stop, fuel", "-6 %", -6, -6, _WHOLE, ("B",), fuel_change("B", "start_stop"), _ENGAGED
    ),
    Statement(
        "C2 conventional, fuel", "-23 to -24 %", -24, -23, _WHOLE, ("C2",),
        fuel_change("C2", "conventional"), _OPEN,
    ),
    Statement(
        "D conventional, fuel", "-23 to -24 %", -24, -23, _WHOLE, ("D",),
        fuel_change("D", "conventional"), _OPEN,
    ),
    Statement(
        "B start_stop, NOx", "about -6 %", -6, -6, _ABOUT, ("B",), nox_change("B", "start_stop"),
        _IDLE,
    ),
    Statement(
        "mean of C1, C2, D, E conventional, NOx", "about -10 %", -10, -10, _ABOUT, HYBRIDS, _mean_nox, _MAP
    ),
    Statement(
        "E nox_cut over conventional, fuel", "+2 to +3 %", 2, 3, _WHOLE, ("E",),
        cut_over_conventional("E", 0), _SEVERE,
    ),
    Statement(
        "D nox_cut over conventional, fuel", "+11 %", 11, 11, _WHOLE, ("D",),
        cut_over_conventional("D", 0), _SEVERE,
    ),
    Statement(
        "E nox_cut over conventional, NOx", "about -6 %", -6, -6, _ABOUT, ("E",),
        cut_over_conventional("E", 1), _SEVERE,
    ),
    Statement(
        "C1 nox_cut over conventional, NOx", "no gain", 0, 0, _ABOUT, ("C1",),
        cut_over_conventional("C1", 1), _UNEXPLAINED,
    ),
)  # fmt: skip


# Not a statement of its own: the mean of the hybrids that the published one may stand for alone.
MEAN_NOX_WITHOUT_C1 = Statement(
    "mean of C2, D, E conventional, NOx", "about -10 %", -10, -10, _ABOUT, HYBRIDS[1:],
    lambda cases: _mean_nox(cases, HYBRIDS[1:]), _MAP,
)  # fmt: skip


def cases_of(comparison: Comparison) -> dict[tuple[str, str], Figures]:
    """The figures of every row that has them, by architecture and strategy."""
    return {
        (row.architecture, row.strategy): Figures(row.fuel_corrected_l_per_100km, row.nox_mg_per_km)
        for row in comparison.rows
        if row.fuel_corrected_l_per_100km and row.nox_mg_per_km
    }


def is_study(cars: Iterable[Architecture], cycle: Cycle) -> bool:
    """Whether a cycle and the cars under the study's names are as shipped, whatever files they come from.

    Cars of other names stand in no statement and do not count.
    """
    if cycle_contents(cycle) != cycle_contents(load_cycle(CYCLE)):
        return False
    return all(
        car.contents == load_architecture(car.name).contents for car in cars if car.name in CARS
    )


def published_beside(comparison: Comparison) -> list[Published]:
    """The published statements with ours, where reference and objective are theirs, and the names; see is_study."""
    theirs = (comparison.cycle, comparison.reference) == (CYCLE, REFERENCE)
    if not theirs or comparison.free_gear or comparison.nox_weight:
        return []
    cases, found = cases_of(comparison), []
    for statement in STATEMENTS:
        try:
            ours = statement.ours(cases)
        except KeyError:
            continue
        found.append(
            Published(statement.what, statement.published, f"{ours:+.1f} %", statement.differs)
        )
    return found
