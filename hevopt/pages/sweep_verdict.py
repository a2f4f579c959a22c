"""What a sweep says in two sentences, and what a reader must know before believing it."""

import re
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import log

import numpy as np
from numpy.typing import NDArray

from hevopt.pages.sweep_data import Figures, Scalar, Sweep
from hevopt.pages.sweep_effects import is_log, is_numeric
from hevopt.pages.verdict import Alert
from hevopt.sweeps.jobs import NOX_WEIGHT

LOOSE_PERCENT = 0.5
# More weights than this are not compared one by one.
GROUPS_MAX = 8
_TIGHT_PERCENT = 0.001
_MESSAGES_LISTED = 5
_EDGE_SHARE = 0.02
_IN_SENTENCE = 3


@dataclass(frozen=True, slots=True, eq=False)
class Group:
    """Designs that compete. weight: theirs, None where there are too many weights to tell them apart.

    ranked: indices of those with an objective (a bound, where nothing else was asked for), the best first
    """

    weight: float | None
    members: NDArray[np.intp]
    ranked: NDArray[np.intp]

    @property
    def label(self) -> str:
        return "all" if self.weight is None else f"{self.weight:g}"


def groups_of(figures: Figures) -> list[Group]:
    """The designs of each NOx weight, by ascending weight."""
    weights = np.unique(figures.weight).tolist()
    merit = figures.merit

    def group(weight: float | None) -> Group:
        chosen = figures.weight == weight if weight is not None else figures.weight >= 0
        members = np.flatnonzero(chosen)
        known = members[np.isfinite(merit[members])]
        return Group(weight, members, known[np.argsort(merit[known], kind="stable")])

    return [group(weight) for weight in (weights if len(weights) <= GROUPS_MAX else [None])]


def shown_value(value: Scalar) -> str:
    """A parameter's value as tables show it."""
    if isinstance(value, float):
        return f"{value:.6g}"
    return str(value).lower() if isinstance(value, bool) else str(value)


def verdict(sweep: Sweep, groups: Sequence[Group]) -> list[str]:
    """Two sentences: the best design under each NOx weight; how many designs and cases there are."""
    figures, counts = sweep.figures, sweep.tally.counts
    found = [group for group in groups if len(group.ranked)]
    if len(found) > _IN_SENTENCE:
        found = [found[0], found[-1]]
    parts = [_best(figures, group) for group in found]
    outcomes = (
        ("ok", "done"),
        *((name, name) for name in ("failed", "infeasible", "missing", "pruned")),
    )
    ended = ", ".join(f"{counts[name]} {word}" for name, word in outcomes)
    designs = len(figures.number)
    best = "; ".join(parts) if parts else "no design is solved"
    return [
        f"{best[0].upper()}{best[1:]}.",
        f"{designs} design{'s' if designs != 1 else ''}, {counts.total()} cases: {ended}.",
    ]


def _best(figures: Figures, group: Group) -> str:
    n = group.ranked[0]
    where = "" if group.weight is None else f"at NOx weight {group.label}, "
    named = f"design {figures.number[n]}{_described(figures, n)}"
    if np.isnan(figures.objective[n]):
        return (
            f"{where}{named} has the least bound: no plan of a design with a bound can go below "
            f"{figures.bound[n]:.4f} l/100 km"
        )
    text = f"{where}{named} is the best: {figures.objective[n]:.4f} l/100 km"
    if group.weight != 0:
        text += " of fuel and weighted NOx"
    if np.isnan(figures.gap_percent[n]):
        return f"{text}, with no bound to hold it against"
    gap = figures.gap_percent[n]
    above = f"{gap:.3f} %" if gap >= _TIGHT_PERCENT else f"less than {_TIGHT_PERCENT:g} %"
    return f"{text}, {above} above its proven bound"


def _described(figures: Figures, n: int) -> str:
    values = [
        f"{key} {shown_value(of[n])}" for key, of in figures.values.items() if key != NOX_WEIGHT
    ]
    more = [f"and {len(values) - 4} more"] if len(values) > 4 else []
    return f" ({', '.join(values[:4] + more)})" if values else ""


def alerts(sweep: Sweep, groups: Sequence[Group]) -> list[Alert]:
    """The checks, in the order of a reader's doubts; each speaks also where there is nothing to say."""
    return [
        _failed(sweep), _infeasible(sweep), _complete(sweep), _certificates(sweep, groups),
        _ranges(sweep.figures, groups), _charge(sweep), *_weights(groups),
    ]  # fmt: skip


def _failed(sweep: Sweep) -> Alert:
    lines = list(_messages(sweep, "failed"))
    return Alert("Failed cases", bool(lines), lines or ["No case failed."])


def _infeasible(sweep: Sweep) -> Alert:
    lines = list(_messages(sweep, "infeasible"))
    nothing = "Every case that was tried can be driven."
    return Alert("Infeasible cases", bool(lines), lines or [nothing], grave=False)


def _messages(sweep: Sweep, outcome: str) -> Iterator[str]:
    """The most frequent messages, those alike but for their numbers as one."""
    kinds: Counter[str] = Counter()
    examples: dict[str, str] = {}
    for (ended, message), count in sweep.tally.messages.items():
        if ended == outcome:
            kind = re.sub(r"\d[\d.]*", "#", message)
            kinds[kind] += count
            examples.setdefault(kind, message)
    for kind, count in kinds.most_common(_MESSAGES_LISTED):
        alike = ", such as" if count > 1 else ""
        yield f"{count} case{'s' if count > 1 else ''}{alike}: {examples[kind]}"
    if len(kinds) > _MESSAGES_LISTED:
        yield f"And {len(kinds) - _MESSAGES_LISTED} other kinds of message."


def _complete(sweep: Sweep) -> Alert:
    missing = sweep.tally.counts["missing"]
    if not missing:
        return Alert("Completeness", False, ["Every planned case has a result."])
    line = f"{missing} of {sweep.tally.counts.total()} cases have no result yet: the best design may change."
    command = sweep.meta.get("command")
    return Alert(
        "Completeness", True, [line, *([f"To go on, run again: {command}"] if command else [])]
    )


def _certificates(sweep: Sweep, groups: Sequence[Group]) -> Alert:
    figures, gaps = sweep.figures, sweep.figures.gap_percent
    lines = []
    if sweep.tally.contradictions:
        lines.append(
            f"{sweep.tally.contradictions} cases lie below their own bound: that cannot be; please report it."
        )
    loose = np.flatnonzero(gaps > LOOSE_PERCENT)
    if len(loose):
        widest = loose[np.argmax(gaps[loose])]
        lines.append(
            f"{len(loose)} of {np.isfinite(gaps).sum()} designs are more than {LOOSE_PERCENT:g} % above the bound,"
            f" up to {gaps[widest]:.2f} % (design {figures.number[widest]}): it is not known whether bound or "
            "strategies are to blame."
        )
    unbound = int((np.isfinite(figures.objective) & np.isnan(figures.bound)).sum())
    if unbound:
        lines.append(f"{unbound} designs have no bound.")
    rest = []
    if not lines and np.isfinite(gaps).any():
        furthest = max(np.nanmax(gaps), 0.0)
        rest = [
            f"Every design lies within {furthest:.3f} % of its bound; loose would be {LOOSE_PERCENT:g} %."
        ]
    rest += _floors(figures, groups)
    return Alert(
        "Certificates",
        bool(lines),
        lines + rest or ["There are bounds alone, nothing to hold against them."],
    )


def _floors(figures: Figures, groups: Sequence[Group]) -> Iterator[str]:
    """What the bounds of all designs together say about the best one."""
    for group in groups:
        bounds = figures.bound[group.members]
        if group.weight is None or not len(group.ranked) or not np.isfinite(bounds).any():
            continue
        best = figures.objective[group.ranked[0]]
        if np.isnan(best):
            continue
        rivals = int((bounds < best).sum()) - int(figures.bound[group.ranked[0]] < best)
        unknown = int(np.isnan(bounds).sum())
        text = "no other design can be better: their bounds lie above the best objective"
        if rivals:
            which = "1 other design could be better: its bound lies"
            if rivals > 1:
                which = f"{rivals} other designs could be better: their bounds lie"
            text = f"{which} below the best objective"
        but = f" ({unknown} without a bound are not known)" if unknown else ""
        yield f"NOx weight {group.label}: {text}{but}."


def _ranges(figures: Figures, groups: Sequence[Group]) -> Alert:
    lines = [
        line
        for group in groups
        if len(group.ranked)
        for key, values in figures.values.items()
        if key != NOX_WEIGHT and (line := _edge(key, values, int(group.ranked[0]), group))
    ]
    nothing = "No best design lies at the end of a parameter's range."
    return Alert("Parameter ranges", bool(lines), lines or [nothing], grave=False)


def _edge(key: str, values: list[Scalar], best: int, group: Group) -> str | None:
    if not is_numeric(values) or min(values) == max(values):
        return None
    low, high, value = min(values), max(values), values[best]
    if is_log(values):
        share = log(value / low) / log(high / low)
    else:
        share = (value - low) / (high - low)
    if _EDGE_SHARE < share < 1 - _EDGE_SHARE:
        return None
    end = "least" if share < 0.5 else "largest"
    where = "" if group.weight is None else f"NOx weight {group.label}: "
    near = "" if value in (low, high) else "close to "
    tried = f"{near}the {end} tried; widen that range"
    return f"{where}the best design has {key} = {shown_value(value)}, {tried}."


def _charge(sweep: Sweep) -> Alert:
    marks: Counter[str] = Counter()
    for status, count in sweep.tally.marks.items():
        for mark in status.split(", "):
            marks[re.sub(r" at \d+ steps?$", "", mark)] += count
    lines = [
        f"{count} case{'s' if count > 1 else ''}: {mark}." for mark, count in marks.most_common()
    ]
    if "not neutral" in marks or "end charge missed" in marks:
        lines.append("Designs are ranked by the charge-corrected objective.")
    nothing = "Every case follows the cycle and ends with the charge asked, within 1 % of the fuel's energy."
    if not sweep.tally.strategies:
        nothing = "No case was driven: the sweep asks for bounds alone."
    return Alert("Charge balance", bool(lines), lines or [nothing])


def _weights(groups: Sequence[Group]) -> Iterator[Alert]:
    if groups[0].weight is None:
        line = (
            f"With more than {GROUPS_MAX} NOx weights all designs are ranked together, though those of different "
            "weights do not compare: give nox_weight as a short list."
        )
        yield Alert("NOx weights", True, [line])
