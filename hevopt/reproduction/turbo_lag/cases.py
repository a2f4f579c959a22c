"""The tip-ins of the published study driven again, variations that say what they depend on, and the hole filled.

F. Millo, L. Rolando, M. Andreata 2011, section 4.1: 40 km/h in IV, 60 km/h in VI, a compact car of 1.3 l.
Its hybrids C1 to E, section 4.2, have a 1.6 l one.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from hevopt.car.engine import Engine
from hevopt.display.facts import Shown
from hevopt.mean_value.full_load import FullLoad
from hevopt.mean_value.rotor import scaled_inertia_kgm2
from hevopt.reproduction.published import HYBRIDS
from hevopt.tipin.bands import Band, bands_of
from hevopt.tipin.case import BASE, Case, variation
from hevopt.tipin.drive import Manoeuvre, TipIn, tip_in
from hevopt.tipin.study import manoeuvre_of, settled_full_load
from hevopt.units import KMH_PER_MPS

SMALL, LARGE = "compact_1300", "A"
SMOKE_LIMITS = (1.1, 1.25, 1.4)
SHARES = (0.85, 1.15)
INERTIAS = (0.5, 2.0)
# Steady map over what the car does at every time of the figures, up to which it feels like its map.
ALIKE = 1.02
_HELPED = Case("with its machine", assist=True)
_HALVINGS = 6


class Pedal(NamedTuple):
    """Where the pedal goes down."""

    kmh: float
    gear: int

    @property
    def text(self) -> str:
        """As the study writes it."""
        return f"{self.kmh:g} km/h, {('I', 'II', 'III', 'IV', 'V', 'VI')[self.gear - 1]}"


FOURTH, SIXTH, SECOND = Pedal(40.0, 4), Pedal(60.0, 6), Pedal(25.0, 2)
# What the start and the seconds after it depend on, one at a time: name -> keys of the car, case.
_OTHERWISE: dict[str, tuple[dict[str, Any], Case]] = {
    "recirculation closed before": ({}, variation("egr", 0.0)),
    "smoke limit by the air meter": (
        {"engine.mean_value.control.smoke_limit_from": "air_meter"},
        BASE,
    ),
    "no heat to the exhaust's wall": ({"engine.mean_value.exhaust_wall.gas_wpk": 0.0}, BASE),
    "twice the heat to it": ({"engine.mean_value.exhaust_wall.gas_wpk": 16.0}, BASE),
    "turbine efficiency 0.50": ({"engine.mean_value.turbine.efficiency_max": 0.50}, BASE),
    "turbine efficiency 0.60": ({"engine.mean_value.turbine.efficiency_max": 0.60}, BASE),
}


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Filled(Shown):
    """A hybrid's tip-in alone and with its machine.

    least_w: power of the smallest machine of this kind with which the car feels like its map; None: none up to
    the shipped one; least_work_j: what that gives
    """

    car: str
    pedal: Pedal
    alone: TipIn
    helped: TipIn
    least_w: float | None
    least_work_j: float | None


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class TurboLag(Shown):
    """All that the page tells.

    shipped: (car, pedal) -> tip-in; lsoda: the largest difference of acceleration to LSODA's, by the same
    smoke: at 60 km/h in VI; inertia, gears, otherwise: at 40 km/h in IV; all of the small car, by name
    second: in II; full_load: car -> settled full load, and its engine by the map
    """

    shipped: Mapping[tuple[str, Pedal], TipIn]
    lsoda: Mapping[tuple[str, Pedal], float]
    smoke: Mapping[str, TipIn]
    inertia: Mapping[str, TipIn]
    gears: Mapping[str, TipIn]
    otherwise: Mapping[str, TipIn]
    second: TipIn
    filled: tuple[Filled, ...]
    full_load: Mapping[str, tuple[FullLoad, Engine]]
    bands: tuple[Band, ...]


def turbo_lag(
    progress: Callable[[str, int, int], None] = lambda text, done, total: None,
) -> TurboLag:
    """Everything driven; takes about a minute."""
    total = 7 + 2 * len(HYBRIDS)
    progress("tip-ins as shipped", 0, total)
    places = [(car, pedal) for car in (SMALL, LARGE) for pedal in (FOURTH, SIXTH)]
    shipped = {place: tip_in(_manoeuvre(*place), BASE) for place in places}
    progress("the same by LSODA", 1, total)
    lsoda = {place: _by_lsoda(*place, shipped[place]) for place in places}
    progress("smoke limits", 2, total)
    fourth, sixth = _manoeuvre(SMALL, FOURTH), _manoeuvre(SMALL, SIXTH)
    smoke = _varied(sixth, *(variation("smoke", limit) for limit in SMOKE_LIMITS))
    progress("turbocharger and gears", 3, total)
    gearbox = fourth.architecture.gearbox
    assert gearbox is not None
    final = float(gearbox.ratios[0])
    gears = [variation("final_drive", round(share * final, 4)) for share in SHARES]
    inertia, geared = _varied(fourth, *_inertias(fourth)), _varied(fourth, *gears)
    progress("what it depends on", 4, total)
    otherwise = {
        name: tip_in(_manoeuvre(SMALL, FOURTH, changes), case)
        for name, (changes, case) in _OTHERWISE.items()
    }
    second = tip_in(_manoeuvre(SMALL, SECOND), BASE)
    bands = bands_of(fourth, shipped[SMALL, FOURTH].figures)
    progress("full load", 5, total)
    engines = {SMALL: "engine_diesel_1300", LARGE: "engine_diesel_1600"}
    full_load = {car: settled_full_load(engine) for car, engine in engines.items()}
    filled = []
    for n, (pedal, car) in enumerate((p, c) for p in (FOURTH, SIXTH) for c in HYBRIDS):
        progress(f"{car} at {pedal.text}", 6 + n, total)
        filled.append(_filled(car, pedal))
    return TurboLag(
        shipped, lsoda, smoke, inertia, geared, otherwise, second, tuple(filled), full_load, tuple(bands)
    )  # fmt: skip


def feels_alike(found: TipIn) -> bool:
    """Whether the steady map is nowhere among the figures' times faster by more than ALIKE."""
    return max(found.figures.ratio) <= ALIKE


def _manoeuvre(car: str, pedal: Pedal, changes: Mapping[str, Any] | None = None) -> Manoeuvre:
    return manoeuvre_of(car, pedal.kmh / KMH_PER_MPS, pedal.gear, changes=changes)


def _varied(manoeuvre: Manoeuvre, *cases: Case) -> dict[str, TipIn]:
    return {case.label: tip_in(manoeuvre, case) for case in cases}


def _inertias(manoeuvre: Manoeuvre) -> list[Case]:
    """Half and twice the inertia, and the two that scaling from known rotors gives."""
    engine = manoeuvre.diesel.engine
    _, *scaled = scaled_inertia_kgm2(engine.compressor.wheel_diameter_m)
    shares = [round(inertia / engine.rotor.inertia_kgm2, 3) for inertia in scaled]
    return [variation("turbo_inertia", share) for share in sorted([*INERTIAS, *shares])]


def _by_lsoda(car: str, pedal: Pedal, fixed: TipIn) -> float:
    manoeuvre = manoeuvre_of(car, pedal.kmh / KMH_PER_MPS, pedal.gear, integrator="lsoda")
    free = tip_in(manoeuvre, BASE)
    return float(np.abs(fixed.run["accel_mps2"] - free.run["accel_mps2"]).max())


def _filled(car: str, pedal: Pedal) -> Filled:
    manoeuvre = _manoeuvre(car, pedal)
    alone, helped = tip_in(manoeuvre, BASE), tip_in(manoeuvre, _HELPED)
    if not feels_alike(helped):
        return Filled(car, pedal, alone, helped, None, None)
    shipped_w = manoeuvre.architecture.machines[0].power_max_w
    low, high, best = 0.0, 1.0, helped
    for _ in range(_HALVINGS):
        share = (low + high) / 2
        tried = tip_in(_manoeuvre(car, pedal, {"machine.scale.power": share}), _HELPED)
        if feels_alike(tried):
            high, best = share, tried
        else:
            low = share
    assert best.assist is not None
    return Filled(car, pedal, alone, helped, high * shipped_w, best.assist.work_j)
