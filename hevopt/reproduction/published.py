"""The published figures, beside which ours are shown; nothing is tuned towards them.

Source: F. Millo, L. Rolando, M. Andreata, Numerical Simulation for Vehicle Powertrain Development, in Numerical
Analysis - Theory and Application (2011), section 4.2: NEDC, warm, change against A, as the text gives them.
"""

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, NamedTuple

from hevopt.car.architecture import Architecture
from hevopt.driving.cycle import Cycle, load_cycle
from hevopt.studies.provenance import cycle_contents

if TYPE_CHECKING:
    from hevopt.studies.comparison import Comparison

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
    """One published statement, from `low` to `high` per cent, and what of ours it is about.

    rounding: half of what its last digit says, or a whole per cent where the text says "about"
    figure: 0 fuel, 1 NOx; of: the cases whose mean change it is, against `over` of the same car, or against A
    section: of the reproduction, from 1; differs: in a few words, why ours is another
    """

    what: str
    published: str
    low: float
    high: float
    rounding: float
    figure: int
    of: tuple[tuple[str, str], ...]
    over: str | None
    section: int
    differs: str

    def ours(self, cases: Cases) -> float:
        """The change in ours, per cent; KeyError where a case of it is none of ours."""
        changes = [
            percent(cases[case][self.figure], cases[self._base_of(case)][self.figure])
            for case in self.of
        ]
        return sum(changes) / len(changes)

    @property
    def cars(self) -> tuple[str, ...]:
        """The cars that it speaks of."""
        return tuple(car for car, _ in self.of)

    @property
    def cases(self) -> tuple[tuple[str, str], ...]:
        """The cases that it is worked out from, without A's."""
        bases = [self._base_of(case) for case in self.of if self.over is not None]
        return (*self.of, *bases)

    def _base_of(self, case: tuple[str, str]) -> tuple[str, str]:
        return _BASE if self.over is None else (case[0], self.over)


class Published(NamedTuple):
    """One statement: what is compared, the published value, ours, and what differs."""

    what: str
    published: str
    ours: str
    differs: str


def percent(value: float, base: float) -> float:
    """Change against a base."""
    return 100 * (value / base - 1)


_FUEL, _NOX = 0, 1


def _mean_nox_of(cars: tuple[str, ...]) -> Statement:
    of = tuple((car, "conventional") for car in cars)
    what = f"mean of {', '.join(cars)} conventional, NOx"
    return Statement(what, "about -10 %", -10, -10, _ABOUT, _NOX, of, None, 4, _MAP)


_ENGAGED = "ours keeps the engine on in every K phase; without that it is close"
_OPEN = "thresholds of theirs, and the share of the braking that it takes, are not said: hevopt reproduction"
_IDLE = "NOx of the map at idle, engine on in the K phases: hevopt reproduction"
_MAP = "NOx map, and thresholds calibrated for fuel alone: hevopt reproduction"
_SEVERE = "ours takes the family's least NOx, whatever it costs in fuel"
_UNEXPLAINED = "not explained: hevopt reproduction"
_RULE, _CUT = "conventional", "nox_cut"
MEAN_NOX = _mean_nox_of(HYBRIDS)
# Not a statement of its own: the mean of the hybrids that the published one may stand for alone.
MEAN_NOX_WITHOUT_C1 = _mean_nox_of(HYBRIDS[1:])
STATEMENTS: tuple[Statement, ...] = (
    Statement(
        "B start_stop, fuel", "-6 %", -6, -6, _WHOLE, _FUEL, (("B", "start_stop"),), None, 1, _ENGAGED
    ),
    Statement(
        "C2 conventional, fuel", "-23 to -24 %", -24, -23, _WHOLE, _FUEL, (("C2", _RULE),), None, 2, _OPEN
    ),
    Statement(
        "D conventional, fuel", "-23 to -24 %", -24, -23, _WHOLE, _FUEL, (("D", _RULE),), None, 2, _OPEN
    ),
    Statement(
        "B start_stop, NOx", "about -6 %", -6, -6, _ABOUT, _NOX, (("B", "start_stop"),), None, 3, _IDLE
    ),
    MEAN_NOX,
    Statement(
        "E nox_cut over conventional, fuel", "+2 to +3 %", 2, 3, _WHOLE, _FUEL, (("E", _CUT),), _RULE, 5, _SEVERE
    ),
    Statement(
        "D nox_cut over conventional, fuel", "+11 %", 11, 11, _WHOLE, _FUEL, (("D", _CUT),), _RULE, 5, _SEVERE
    ),
    Statement(
        "E nox_cut over conventional, NOx", "about -6 %", -6, -6, _ABOUT, _NOX, (("E", _CUT),), _RULE, 5, _SEVERE
    ),
    Statement(
        "C1 nox_cut over conventional, NOx", "no gain", 0, 0, _ABOUT, _NOX, (("C1", _CUT),), _RULE, 5, _UNEXPLAINED
    ),
)  # fmt: skip


def cases_of(comparison: "Comparison") -> dict[tuple[str, str], Figures]:
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
    from hevopt.car_files.load import load_architecture

    if cycle_contents(cycle) != cycle_contents(load_cycle(CYCLE)):
        return False
    return all(
        car.contents == load_architecture(car.name).contents for car in cars if car.name in CARS
    )


def published_beside(comparison: "Comparison") -> list[Published]:
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
