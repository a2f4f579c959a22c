"""The tip-ins on the page: as shipped, what changes them, and the hole filled."""

from collections.abc import Iterable, Sequence

import numpy as np

from hevopt.reproduction.turbo_lag.cases import (
    ALIKE,
    FOURTH,
    LARGE,
    SIXTH,
    SMALL,
    Filled,
    Pedal,
    TurboLag,
)
from hevopt.reproduction.verdicts import markdown
from hevopt.tipin.drive import TipIn
from hevopt.tipin.figures import TIMES_S
from hevopt.units import KMH_PER_MPS, RPM_PER_RADPS

NAMES = {SMALL: "1.3 l, `compact_1300`", LARGE: "1.6 l, `A`"}
_SHOWN_S = (0.3, 1.0, 2.0, 3.0)
_LATER = [f"{t:g} s" for t in TIMES_S[1:]]
_HEADS = [
    f"a, m/s², {TIMES_S[0]:g} s", *_LATER, f"map / a, {TIMES_S[0]:g} s", *_LATER, "90 % boost, s",
    "90 % torque, s", "gained in 5 s, km/h", "by the map", "hole, Nm s", "kJ",
]  # fmt: skip


def _table(first: str, rows: Iterable[tuple[str, TipIn]]) -> str:
    align = "l" + "r" * len(_HEADS)
    return markdown([first, *_HEADS], align, [[name, *_cells(one)] for name, one in rows])


def _cells(found: TipIn) -> list[str]:
    of = found.figures
    return [
        *(f"{a:.2f}" for a in of.accel_mps2),
        *(f"{r:.2f}" for r in of.ratio),
        _seconds(of.boost_90_s),
        _seconds(of.torque_90_s),
        f"{of.gained_mps * KMH_PER_MPS:.1f}",
        f"{of.map_gained_mps * KMH_PER_MPS:.1f}",
        f"{of.hole_nms:.0f}",
        f"{of.hole_j / 1e3:.1f}",
    ]


def _seconds(value: float | None) -> str:
    return "-" if value is None else f"{value:.2f}"


def shipped(found: TurboLag) -> str:
    """Both cars, both manoeuvres, and the constant speed before."""
    rows = [(f"{NAMES[car]}, {pedal.text}", one) for (car, pedal), one in found.shipped.items()]
    heads = [
        "before", "engine, rpm", "turbocharger, krpm", "boost, bar", "pedal, %", "recirculated, %",
        "burnt in the manifold, %", "λ",
    ]  # fmt: skip
    before = [[name, *_before(one)] for name, one in rows]
    small, large = (_mean_pressure_bar(found, car) for car in (SMALL, LARGE))
    return (
        "## 1. The tip-ins\n\n" + _table("car and manoeuvre", rows)
        + "\n\nThe constant speed before decides the first half second; it is settled, not chosen:\n\n"
        + markdown(heads, "lrrrrrrr", before)
        + "\n\nThe 1.6 l engine lags more: its turbocharger is larger, and its full load at 1250 rpm asks for "
        f"{large:.0f} bar of mean pressure, that of the other for {small:.0f}."
    )  # fmt: skip


def _before(found: TipIn) -> list[str]:
    of = found.figures.start
    return [
        f"{of.engine_radps * RPM_PER_RADPS:.0f}",
        f"{of.turbo_radps * RPM_PER_RADPS / 1e3:.1f}",
        f"{of.boost_pa / 1e5:.3f}",
        f"{100 * of.pedal:.0f}",
        f"{100 * of.egr_share:.0f}",
        f"{100 * of.burnt_share:.0f}",
        f"{of.excess_air:.2f}",
    ]


def _mean_pressure_bar(found: TurboLag, car: str) -> float:
    """Brake mean pressure of full load at 1250 rpm."""
    torque = float(found.full_load[car][1].full_load_nm(np.array([1250 / RPM_PER_RADPS]))[0])
    cylinders = found.shipped[car, FOURTH].run.model.engine.cylinders
    return 4e-5 * float(np.pi) * torque / cylinders.displacement_m3


def smoke(found: TurboLag) -> str:
    """Three smoke limits at 60 km/h in VI."""
    shares = (
        f"{100 * one.figures.settled_share:.0f} % with {label}"
        for label, one in found.smoke.items()
    )
    return (
        f"## 2. Smoke limits\n\n{NAMES[SMALL]} at {SIXTH.text}, least λ of the cylinders at every speed.\n\n"
        + _table("case", found.smoke.items())
        + "\n\nA limit leaner than full load itself takes torque for good, and its pattern holds lag and loss "
        f"together: of the file's full load, full pedal settles to {', '.join(shares)}."
    )  # fmt: skip


def turbocharger(found: TurboLag) -> str:
    """Inertia and gears at 40 km/h in IV."""
    base = found.shipped[SMALL, FOURTH]
    heavy, own = found.inertia["turbo inertia x 2"].figures.boost_90_s, base.figures.boost_90_s
    longer = f"{heavy / own:.2f}" if heavy is not None and own is not None else "-"
    return (
        f"## 3. Turbocharger and gears\n\n{NAMES[SMALL]} at {FOURTH.text}. No maker tells the inertia; scaled by "
        "the wheel's size from two known rotors it is one of the two factors next to 1: its uncertainty.\n\n"
        + _table("case", [("as shipped", base), *found.inertia.items(), *found.gears.items()])
        + f"\n\nWith twice the inertia 90 % of boost comes {longer} times as late. A shorter final drive pulls "
        "harder and is further from its map at the start, where the turbocharger is hardly faster."
    )  # fmt: skip


def otherwise(found: TurboLag) -> str:
    """One assumption at a time."""
    rows = [("as shipped", found.shipped[SMALL, FOURTH]), *found.otherwise.items()]
    return (
        f"## 4. What it depends on\n\n{NAMES[SMALL]} at {FOURTH.text}, one assumption at a time. Recirculation "
        "before the tip-in makes the first half second; turbine efficiency and the heat that the exhaust's wall "
        "takes make the seconds after. None of them is known of a real car: the time to boost is known no better "
        "than this table spreads.\n\n" + _table("case", rows)
    )  # fmt: skip


def filled(found: TurboLag, picture: str) -> str:
    """The machines of C1 to E."""
    heads = [
        "manoeuvre, car", "machine", f"map / a at {_times(_SHOWN_S)} s alone", "with it", "hole filled, %",
        "work, kJ", "electric, kJ", "stored, kJ", "peak, kW", "limited by", "least machine, kW", "its work, kJ",
    ]  # fmt: skip
    rows = [_filled_row(one) for one in found.filled]
    return (
        "## 5. The hole filled\n\nThe hybrids of section 4.2, their 1.6 l engine by the mean-value model, their "
        "machine adding what the engine lacks of the steady map's torque, as far as its torque, its power and the "
        "battery let it. The car is driven forward in time with both together: as it is faster, the turbocharger "
        f"is too. It feels like its map where the map is faster by no more than {100 * (ALIKE - 1):.0f} % at any "
        f"of {_times(TIMES_S)} s. *Least machine*: the smallest of its kind with which it still does, mass kept. "
        "Work is until the end of the run, after 8 s.\n\n"
        + markdown(heads, "ll" + "r" * 7 + "lrr", rows)
        + "\n\n![Acceleration of the hybrids by their steady map, alone and with their machines, and the machines' "
        f"power over time]({picture})\n\n" + " ".join(_verdict(found, pedal) for pedal in (FOURTH, SIXTH))
    )  # fmt: skip


def _filled_row(one: Filled) -> list[str]:
    assist = one.helped.assist
    assert assist is not None
    return [
        f"{one.pedal.text}, {one.car}",
        assist.machine,
        _ratios(one.alone),
        _ratios(one.helped),
        f"{100 * assist.filled:.0f}",
        f"{assist.work_j / 1e3:.1f}",
        f"{assist.electric_j / 1e3:.1f}",
        f"{assist.chemical_j / 1e3:.1f}",
        f"{assist.peak_w / 1e3:.1f}",
        assist.limited_by,
        "-" if one.least_w is None else f"{one.least_w / 1e3:.1f}",
        "-" if one.least_work_j is None else f"{one.least_work_j / 1e3:.1f}",
    ]


def _ratios(found: TipIn) -> str:
    ratio = dict(zip(TIMES_S, found.figures.ratio, strict=True))
    return ", ".join(f"{ratio[time]:.2f}" for time in _SHOWN_S)


def _times(times_s: Sequence[float]) -> str:
    return ", ".join(f"{time:g}" for time in times_s)


def _span(least: float, most: float) -> str:
    low, high = f"{least:.0f}", f"{most:.0f}"
    return low if low == high else f"{low} to {high}"


def _verdict(found: TurboLag, pedal: Pedal) -> str:
    """Which machines do it, and what it takes."""
    of = [one for one in found.filled if one.pedal == pedal]
    work = [a.work_j / 1e3 for a in (one.helped.assist for one in of) if a is not None]
    alike = ", ".join(one.car for one in of if one.least_w is not None)
    text = f"At {pedal.text} "
    if alike:
        least = min(one.least_w for one in of if one.least_w is not None)
        text += (
            f"the machines of {alike} make the diesel feel like its steady map; {least / 1e3:.0f} kW and "
            f"{_span(min(work), max(work))} kJ of work are what it takes"
        )
    else:
        text += "no machine makes the diesel feel like its steady map"
    for one in of:
        if one.least_w is None and one.helped.assist is not None:
            behind = 100 * (max(one.helped.figures.ratio) - 1)
            text += f"; {one.car} stays up to {behind:.0f} % behind, by its {one.helped.assist.limited_by}"
    return text + "."
