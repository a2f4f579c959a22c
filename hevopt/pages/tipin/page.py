"""The page of a study of tip-ins: one HTML file."""

import gzip
import json
from collections.abc import Mapping, Sequence

from hevopt.errors import HevoptError
from hevopt.files.lookup import without_folders
from hevopt.mean_value.balances import balances
from hevopt.pages.alert import Alert
from hevopt.pages.render import render
from hevopt.pages.tipin.drawing import DRAWN_MAX, drawn
from hevopt.studies.provenance import digests_shown, files_digests, versions
from hevopt.tipin.bands import Band
from hevopt.tipin.drive import Manoeuvre, TipIn, inertia_said, titled
from hevopt.tipin.figures import DEFINITIONS, TIMES_S
from hevopt.units import KMH_PER_MPS, RPM_PER_RADPS

_SMALL_RESIDUAL = 1e-10
_REACHED = 0.97


def tipin_page(
    manoeuvre: Manoeuvre,
    found: Sequence[TipIn],
    failed: Mapping[str, HevoptError],
    bands: Sequence[Band],
    command: str,
) -> str:
    """The page as HTML. found: the cases driven, the base first; bands: none where another car is driven"""
    data = json.dumps(drawn(manoeuvre, found), separators=(",", ":"), allow_nan=False)
    return render(
        "tipin.html.j2",
        ("tipin.js",),
        gzip.compress(data.encode(), 6, mtime=0),
        title=titled(manoeuvre),
        car=manoeuvre.architecture,
        verdict=_verdict(found),
        alerts=_alerts(found, failed),
        found=found,
        drawn_max=DRAWN_MAX,
        groups=[tip_in.case.label for tip_in in found],
        times=TIMES_S,
        definitions=DEFINITIONS,
        start=found[0].figures.start,
        inertia=inertia_said(manoeuvre),
        rpm=RPM_PER_RADPS,
        kmh=KMH_PER_MPS,
        bands=bands,
        balances=[(tip_in.case.label, balances(tip_in.run)) for tip_in in found[:DRAWN_MAX]],
        helped=[tip_in for tip_in in found if tip_in.assist is not None],
        failed={label: str(error) for label, error in failed.items()},
        manoeuvre=manoeuvre,
        command=command,
        inputs=digests_shown(files_digests([manoeuvre.architecture], [])),
        versions=versions(),
    )


def _verdict(found: Sequence[TipIn]) -> list[str]:
    base = found[0].figures
    later = TIMES_S[-1]
    words = [
        f"With a steady map the car would accelerate {base.ratio[0]:.2f} times as fast {TIMES_S[0]:g} s after the "
        f"pedal, {base.ratio[2]:.2f} times after {TIMES_S[2]:g} s and {base.ratio[-1]:.2f} times after {later:g} s."
    ]
    if base.boost_90_s is None:
        words.append("Boost does not reach 90 % of its target within the run.")
    else:
        words.append(f"Boost reaches 90 % of its target after {base.boost_90_s:.2f} s.")
    words.append(
        f"In 5 s the car gains {base.gained_mps * KMH_PER_MPS:.1f} km/h, by the map "
        f"{base.map_gained_mps * KMH_PER_MPS:.1f}; the torque that is missing comes to {base.hole_nms:.0f} Nm s or "
        f"{base.hole_j / 1e3:.1f} kJ, at most {base.hole_peak_w / 1e3:.1f} kW."
    )
    for tip_in in found:
        if tip_in.assist is not None:
            words.append(
                f"Its machine fills {100 * tip_in.assist.filled:.0f} % of what is missing, with "
                f"{tip_in.assist.work_j / 1e3:.0f} kJ of work and {tip_in.assist.electric_j / 1e3:.0f} kJ "
                "from the battery."
            )
    return words


def _alerts(found: Sequence[TipIn], failed: Mapping[str, HevoptError]) -> list[Alert]:
    rich = [
        f"{t.case.label}: lambda falls to {t.figures.least_excess_air:.2f}, as the limit sees the air meter"
        for t in found
        if t.run.model.control.air_meter and t.figures.least_excess_air < _limit(t) - 0.01
    ]
    surging = [
        f"{t.case.label}: flow falls to {t.figures.surge_margin:.2f} times that at surge"
        for t in found
        if t.figures.surge_margin < 1
    ]
    short = [
        f"{t.case.label}: full pedal settles to {100 * t.figures.settled_share:.0f} % of the file's full load; the "
        "ratios hold the lag and this together"
        for t in found
        if not _REACHED <= t.figures.settled_share <= 2 - _REACHED
    ]
    open_balances = [
        f"{t.case.label}, {b.name}: {b.residual:.1e} of what went through"
        for t in found
        for b in balances(t.run)
        if abs(b.residual) > _SMALL_RESIDUAL
    ]
    lost = [f"{label}: {without_folders(str(error))}" for label, error in failed.items()]
    worth = [
        "no measured map, inertia, boost or tip-in of the shipped engines is public: a comparison of models"
    ]
    return [
        Alert("Smoke limit", bool(rich), rich or ["lambda stays at the limit or above"]),
        Alert("Surge", bool(surging), surging or ["flow stays above that at surge"]),
        Alert("Steady reference", bool(short), short or ["settled full load is the file's to 3 %"], grave=False),
        Alert("Balances", bool(open_balances), open_balances or ["mass, burnt mass, energy and rotor work close"]),
        Alert("Failed cases", bool(failed), lost or ["every case was driven"]),
        Alert("What it is worth", True, worth, grave=False),
    ]  # fmt: skip


def _limit(tip_in: TipIn) -> float:
    """The least of the smoke limit's curve."""
    from hevopt.mean_value.parameters import SMOKE, curve_of

    return float(curve_of(tip_in.run.model.curves, SMOKE)[1].min())
