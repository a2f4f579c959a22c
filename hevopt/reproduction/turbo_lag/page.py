"""The page of the tip-in study, Markdown: every figure in it comes from a TurboLag, none is typed."""

from collections.abc import Iterable, Mapping
from itertools import pairwise

from hevopt.reproduction.turbo_lag import proofs, sections
from hevopt.reproduction.turbo_lag.cases import FOURTH, SECOND, SIXTH, SMALL, SMOKE_LIMITS, TurboLag
from hevopt.reproduction.verdicts import markdown
from hevopt.tipin.drive import TipIn
from hevopt.tipin.figures import DEFINITIONS, TIMES_S
from hevopt.units import STANDARD_GRAVITY_MPS2

COMMAND = "hevopt turbo-lag --out reports/tipin.md"

_ONE_S = TIMES_S.index(1.0)
# What counts as twice, and by how much patterns of acceleration differ after 1 s.
_TWICE, _PATTERNS_APART = (1.75, 2.25), 0.1
_AGREES, _DOES_NOT = "agrees", "**does not agree**"
_OPEN = "open: no measured tip-in of the car is public, and the text has no figure"


def page(found: TurboLag, picture: str) -> str:
    """The whole page. picture: name of the file that `filled_figure` makes, beside the page"""
    parts = [
        _head(),
        _claims(found),
        sections.shipped(found),
        sections.smoke(found),
        sections.turbocharger(found),
        sections.otherwise(found),
        sections.filled(found, picture),
        proofs.full_load(found),
        proofs.proofs(found),
        _definitions(),
    ]
    return "\n\n".join(parts) + "\n"


def _head() -> str:
    return f"""# The published tip-in study beside ours

Made by `{COMMAND}`, every figure computed by it; the same inputs give the same page.

The study: F. Millo, L. Rolando, M. Andreata, *Numerical Simulation for Vehicle Powertrain Development*, in
*Numerical Analysis - Theory and Application* (2011), section 4.1. A car holds its speed in a gear, and the driver
puts the pedal down. By the steady map of its engine it pulls at once; the mean-value model has five volumes of gas,
a turbocharger, exhaust recirculation and a control unit between pedal and torque.

The study's text holds words and no figure but "twice"; its engine and car are named by class. Ours are built from
sizes of that class and published torque and power, and tuned to nothing on this page. What is compared are models;
where that leaves a claim open, the page says so."""


def _claims(found: TurboLag) -> str:
    rows = [
        _claim_of_twice(found),
        ["(b) the mean-value model is close to the measured car, and still somewhat fast", "-", _OPEN],
        ["(c) as its boost is somewhat high", "-", _OPEN],
        _claim_of_patterns(found),
        [
            "(e) inertia of the turbocharger and gear ratios can be studied",
            f"90 % of boost after {_span_s(found.inertia)} by inertia, {_span_s(found.gears)} by final drive",
            _AGREES,
        ],
        _claim_of_slip(found),
    ]  # fmt: skip
    return "## Claim by claim\n\n" + markdown(["the study", "ours", "stands"], "lll", rows)


def _claim_of_twice(found: TurboLag) -> list[str]:
    one = found.shipped[SMALL, FOURTH]
    ratio, (low, high) = one.figures.ratio, _TWICE
    holds = low <= ratio[0] <= high and list(ratio) == sorted(ratio, reverse=True)
    told = ", ".join(f"{r:.2f} at {t:g} s" for r, t in zip(ratio, TIMES_S, strict=True))
    return [
        f"(a) {FOURTH.text}: a steady model accelerates up to twice as fast, mostly at the start",
        f"{told} times as fast",
        _AGREES
        if holds
        else f"{_DOES_NOT}: {low:g} to {high:g} at {TIMES_S[0]:g} s would; {_twice_until(one)}",
    ]


def _twice_until(one: TipIn) -> str:
    late = one.run.time_s >= TIMES_S[0]
    more = one.by_map["accel_mps2"][late] > 2.0 * one.run["accel_mps2"][late]
    if not more.any():
        return "it is never twice"
    return f"it is more than twice until {one.run.time_s[late][more][-1]:.2f} s"


def _claim_of_patterns(found: TurboLag) -> list[str]:
    after = [one.figures.accel_mps2[_ONE_S] for one in found.smoke.values()]
    apart = min(richer / leaner - 1 for richer, leaner in pairwise(after))
    limits = ", ".join(f"{limit:g}" for limit in SMOKE_LIMITS)
    return [
        f"(d) {SIXTH.text}: three smoke maps give three patterns of acceleration",
        f"λ at least {limits}: {', '.join(f'{a:.2f}' for a in after)} m/s² after 1 s",
        _AGREES if apart > _PATTERNS_APART else _DOES_NOT,
    ]


def _claim_of_slip(found: TurboLag) -> list[str]:
    most = float(found.second.run["accel_mps2"].max()) / STANDARD_GRAVITY_MPS2
    return [
        "(f) in second gear a tyre with slip would be needed",
        f"{SECOND.text}: up to {most:.2f} g, of the driven axle's load alone about twice that share",
        "ours has none either: the tyre's relaxation, and no slip",
    ]


def _span_s(found: Mapping[str, TipIn]) -> str:
    times: Iterable[float | None] = (one.figures.boost_90_s for one in found.values())
    known = [time for time in times if time is not None]
    return f"{min(known):.2f} to {max(known):.2f} s"


def _definitions() -> str:
    lines = [f"- {name}: {text}" for name, text in DEFINITIONS.items()]
    return "## What the columns mean\n\n" + "\n".join(lines)
