"""What a reader of a sweep must know before believing its verdict."""

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from math import log

import numpy as np

from hevopt.pages.alert import Alert
from hevopt.pages.sweep.data import DesignFigures, Scalar, Sweep
from hevopt.pages.sweep.effects import is_log, is_numeric
from hevopt.pages.sweep.verdict import GROUPS_MAX, Group, shown_value
from hevopt.sweeps.plan.jobs import NOX_WEIGHT, Ending
from hevopt.sweeps.store.reasons import Reason

LOOSE_PERCENT = 0.5
_MESSAGES_LISTED = 5
_EDGE_SHARE = 0.02


def alerts(sweep: Sweep, groups: Sequence[Group]) -> list[Alert]:
    """The checks, in the order of a reader's doubts; each speaks also where there is nothing to say."""
    return [
        _failed(sweep), _infeasible(sweep), _followed(sweep), _complete(sweep), *_discarded(sweep),
        _certificates(sweep, groups), _ranges(sweep.figures, groups), _charge(sweep), *_weights(groups),
    ]  # fmt: skip


def _failed(sweep: Sweep) -> Alert:
    lines = _cases(sweep.tally.reasons.of(Ending.FAILED))
    return Alert("Failed cases", bool(lines), lines or ["No case failed."])


def _infeasible(sweep: Sweep) -> Alert:
    lines = _cases(sweep.tally.reasons.of(Ending.INFEASIBLE))
    nothing = "No case is infeasible."
    return Alert("Infeasible cases", bool(lines), lines or [nothing], grave=False)


def _followed(sweep: Sweep) -> Alert:
    figures = sweep.figures
    if not sweep.tally.strategies:
        nothing = "No case was driven: that designs follow the cycle is not known."
    elif figures.short.any():
        worst = int(np.argmax(figures.steps_short))
        steps = f"{figures.steps_short[worst]} step{'s' if figures.steps_short[worst] > 1 else ''}"
        count = int(figures.short.sum())
        cases = sum(n for status, n in sweep.tally.marks.items() if status.shortfall_steps)
        lines = [
            f"{count} of {len(figures.number)} designs do not follow the cycle ({cases} "
            f"case{'s' if cases > 1 else ''}): too weak, they drive on with what they have, on up to {steps} "
            f"(design {figures.number[worst]}).",
            "They do less than is asked, which saves fuel. They rank after all designs that follow, marked in "
            "their status, and count neither in the front nor in the main effects.",
        ]
        return Alert("Steps not followed", True, lines)
    else:
        nothing = "Every case that was driven follows its cycle."
    return Alert("Steps not followed", False, [nothing])


def _discarded(sweep: Sweep) -> Iterator[Alert]:
    count = len(sweep.pruned)
    if count:
        line = (
            f"{count} design{'s were' if count > 1 else ' was'} pruned on the objective alone. The best "
            "design of a weight is that of the whole study; lower ranks and the front of fuel and NOx may lack "
            "pruned designs, and means of the main effects are withheld."
        )
        yield Alert("Pruned designs", True, [line], grave=False)


def _cases(found: Sequence[Reason], what: str = "") -> list[str]:
    """The most frequent reasons, and of what they are."""
    lines = [
        f"{reason.count} cases, such as design {reason.design}: {what}{reason.example}"
        if reason.count > 1
        else f"1 case, design {reason.design}: {what}{reason.example}"
        for reason in found[:_MESSAGES_LISTED]
    ]
    if len(found) > _MESSAGES_LISTED:
        lines.append(f"And {len(found) - _MESSAGES_LISTED} other kinds of message.")
    return lines


def _complete(sweep: Sweep) -> Alert:
    missing = sweep.tally.counts[Ending.MISSING]
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
    for kind in sweep.tally.lost:
        lines += _cases(sweep.tally.lost.of(kind), f"{kind} were tried and not found: ")
    unbound = int((np.isfinite(figures.objective) & np.isnan(figures.bound)).sum())
    if unbound:
        lines.append(f"{unbound} designs have no bound.")
    rest = []
    if not lines and np.isfinite(gaps).any():
        furthest = max(np.nanmax(gaps), 0.0)
        rest = [
            f"Every design lies within {furthest:.3f} % of its bound; loose would be {LOOSE_PERCENT:g} %."
        ]
    rest += _by_weights(_floors(figures, groups), groups)
    return Alert(
        "Certificates",
        bool(lines),
        lines + rest or ["There are bounds alone, nothing to hold against them."],
    )


def _by_weights(found: Iterable[tuple[str, str]], groups: Sequence[Group]) -> list[str]:
    """(weight, text) as lines, those of the same text as one; weights are named where one was asked for."""
    weights: dict[str, list[str]] = {}
    for weight, text in found:
        weights.setdefault(text, []).append(weight)
    if _unweighted(groups):
        return list(weights)
    return [
        f"NOx weight{'s' if len(of) > 1 else ''} {', '.join(of)}: {text}"
        for text, of in weights.items()
    ]


def _unweighted(groups: Sequence[Group]) -> bool:
    """Whether no weight on NOx was asked for."""
    return [group.weight for group in groups] == [0.0]


def _floors(figures: DesignFigures, groups: Sequence[Group]) -> Iterator[tuple[str, str]]:
    """(weight, text): what the bounds of all designs together say about the best one."""
    for group in groups:
        bounds = figures.bound[group.members]
        if group.weight is None or not len(group.ranked) or not np.isfinite(bounds).any():
            continue
        best = figures.objective[group.ranked[0]]
        if np.isnan(best) or figures.short[group.ranked[0]]:
            continue
        bounds = bounds[~figures.short[group.members]]
        rivals = int((bounds < best).sum()) - int(figures.bound[group.ranked[0]] < best)
        unknown = int(np.isnan(bounds).sum())
        no = "No" if _unweighted(groups) else "no"
        text = f"{no} other design can be better: their bounds lie above the best objective"
        if rivals:
            which = "1 other design could be better: its bound lies"
            if rivals > 1:
                which = f"{rivals} other designs could be better: their bounds lie"
            text = f"{which} below the best objective"
        but = f" ({unknown} without a bound are not known)" if unknown else ""
        yield group.label, f"{text}{but}."


def _ranges(figures: DesignFigures, groups: Sequence[Group]) -> Alert:
    at_edges = (
        (group.label, line)
        for group in groups
        if len(group.ranked) and group.weight is not None and not figures.short[group.ranked[0]]
        for key, values in figures.values.items()
        if key != NOX_WEIGHT and (line := _edge(key, values, int(group.ranked[0])))
    )
    lines = _by_weights(at_edges, groups)
    nothing = "No best design lies at the end of a parameter's range."
    if groups[0].weight is None:
        nothing = "No design is ranked, so there is none to look at."
    return Alert("Parameter ranges", bool(lines), lines or [nothing], grave=False)


def _edge(key: str, values: list[Scalar], best: int) -> str | None:
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
    near = "" if value in (low, high) else "close to "
    tried = f"{near}the {end} tried; widen that range"
    return f"the best design has {key} = {shown_value(value)}, {tried}."


def _charge(sweep: Sweep) -> Alert:
    marks: Counter[str] = Counter()
    for status, count in sweep.tally.marks.items():
        for mark in ([status.charge] if status.charge else []) + list(status.others):
            marks[mark] += count
    lines = [
        f"{count} case{'s' if count > 1 else ''}: {mark}." for mark, count in marks.most_common()
    ]
    if marks:
        lines.append("Designs are ranked by the charge-corrected objective.")
    nothing = "Every case ends with the charge asked, within 1 % of the fuel's energy."
    if not sweep.tally.strategies:
        nothing = "No case was driven: the sweep asks for bounds alone."
    return Alert("Charge balance", bool(lines), lines or [nothing])


def _weights(groups: Sequence[Group]) -> Iterator[Alert]:
    if groups[0].weight is None:
        line = (
            f"There are more than {GROUPS_MAX} NOx weights, and objectives of different weights do not compare: no "
            "design is ranked, and main effects are withheld. Give nox_weight as a short list for these."
        )
        yield Alert("NOx weights", True, [line])
