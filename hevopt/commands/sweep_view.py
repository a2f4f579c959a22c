"""What a sweep shows while it runs and when it ends."""

import sys
from collections.abc import Iterator
from math import isfinite
from time import monotonic
from typing import TYPE_CHECKING, Any

from hevopt.files.shown import printable, shown

if TYPE_CHECKING:
    from rich import progress as parts
    from rich.table import Table

    from hevopt.sweeps.run import Advance
    from hevopt.sweeps.store.ranking import Ranked
    from hevopt.sweeps.store.reading import Reader
    from hevopt.sweeps.store.reasons import Reason

_LINE_EVERY_S = 10.0
_BEST, _LINES = 5, 20
_ERRORS_LISTED = 3
_PRUNED_LISTED = 3
_ERROR_CHARACTERS = 200


class SweepProgress:
    """A bar on a terminal, or else a line on stderr every ten seconds: how far, how fast, how long, what failed."""

    def __enter__(self) -> "SweepProgress":
        from rich.console import Console

        self._console = Console(stderr=True)
        self._bar: parts.Progress | None = None
        self._said_s = monotonic()
        return self

    def __call__(self, progress: "Advance") -> None:
        if self._console.is_terminal:
            self._draw(progress)
        elif monotonic() - self._said_s >= _LINE_EVERY_S:
            self._said_s = monotonic()
            self.say(f"{progress.done} of {progress.total} cases, {_pace(progress)}")

    def plan(self, done: int, total: int) -> None:
        """Called for every car that is read and checked before anything runs."""
        if monotonic() - self._said_s >= _LINE_EVERY_S:
            self._said_s = monotonic()
            self.say(f"planning: {done} of {total} cars checked")

    def say(self, text: str) -> None:
        """A line on stderr, above the bar where there is one."""
        if self._bar is None:
            print(f"hevopt: {text}", file=sys.stderr, flush=True)
        else:
            self._console.print(f"hevopt: {text}", markup=False, highlight=False)

    def _draw(self, progress: "Advance") -> None:
        from rich import progress as parts

        if self._bar is None:
            self._bar = parts.Progress(
                parts.BarColumn(), parts.MofNCompleteColumn(), parts.TextColumn("{task.fields[pace]}"),
                console=self._console, refresh_per_second=4,
            )  # fmt: skip
            self._bar.add_task("", total=progress.total, pace="")
            self._bar.start()
        self._bar.update(
            self._bar.task_ids[0],
            completed=progress.done,
            total=progress.total,
            pace=_pace(progress),
        )

    def finish(self) -> None:
        """Leave the bar as it is."""
        if self._bar is not None:
            self._bar.stop()

    def __exit__(self, *_: object) -> None:
        self.finish()


def _pace(progress: "Advance") -> str:
    rate = progress.done / max(monotonic() - progress.began_s, 1e-9)
    left = duration((progress.total - progress.done) / rate) if rate else "time unknown"
    pruned = f", {progress.pruned} pruned" if progress.pruned else ""
    return f"{rate:.3g}/s, {left} left, {progress.failed} failed{pruned}"


def duration(seconds: float) -> str:
    """A time as one reads it: 42 s, 3 min 20 s, 5 h 2 min, 3 d 4 h."""
    if not isfinite(seconds) or seconds < 59.5:
        return f"{seconds:.2g} s" if seconds < 9.5 else f"{seconds:.0f} s"
    parts: list[str] = []
    rest = round(seconds)
    for unit, size in (("d", 86400), ("h", 3600), ("min", 60), ("s", 1)):
        count, rest = divmod(rest, size)
        parts += [f"{count} {unit}"] if count or parts else []
    return " ".join(parts[:2])


def counted(counts: dict[str, int]) -> str:
    """The cases of a plan by ending, in one line."""
    from hevopt.sweeps.plan.jobs import Ending

    listed = ", ".join(f"{counts[ending]} {ending}" for ending in Ending if counts[ending])
    total = sum(counts[ending] for ending in Ending)
    other = (
        f"; {counts['other']} more results are kept, of other inputs, strategies or code"
        if counts["other"]
        else ""
    )
    return f"{total} cases of {counts['designs']} designs: {listed or 'none'}{other}"


def reasons(reader: "Reader") -> list[str]:
    """The most frequent errors of cases without a row, and of lost proofs, each with the first design hit."""
    from hevopt.sweeps.plan.jobs import Ending
    from hevopt.sweeps.store.reasons import Reasons

    found, lost = Reasons(), Reasons()
    for record in reader.records():
        if record.failure is not None:
            found.add(record.ending, record.failure.headline, record.design)
        for kind, why in ((record.row or {}).get("lost_proofs") or {}).items():
            lost.add(kind, why, record.design)
    return [
        line
        for what, reasons in (
            *((ending, found.of(ending)) for ending in (Ending.FAILED, Ending.INFEASIBLE)),
            *((f"{kind} not found", lost.of(kind)) for kind in lost),
        )
        for line in _reasons(reasons, what)
    ]


def _reasons(found: "list[Reason]", what: str) -> Iterator[str]:
    for reason in found[:_ERRORS_LISTED]:
        text = reason.example
        text = text if len(text) <= _ERROR_CHARACTERS else text[: _ERROR_CHARACTERS - 3] + "..."
        times = "once" if reason.count == 1 else f"{reason.count} times, first"
        yield f"{what} {times} in design {reason.design}: {text}"
    if len(found) > _ERRORS_LISTED:
        more = len(found) - _ERRORS_LISTED
        yield f"{what}: and {more} more kinds of reason; --export lists them"


def discarded(reader: "Reader") -> list[str]:
    """The first pruned designs, each with its bound and what condemned it."""
    found = reader.pruned()
    lines = [
        f"design {p.design} pruned: its bound, {p.bound:.4f} l/100km, is above the objective of design "
        f"{p.incumbent}, {p.objective:.4f}"
        for p in found[:_PRUNED_LISTED]
    ]
    more = len(found) - _PRUNED_LISTED
    return [*lines, f"and {more} more designs pruned; --export lists them"] if more > 0 else lines


def best_table(reader: "Reader") -> "tuple[Table | None, int]":
    """The best designs with their objective and bound, None without any; how many NOx weights are left out."""
    from rich import box
    from rich.table import Table
    from rich.text import Text

    from hevopt.sweeps.store.ranking import best_designs

    best = best_designs(reader, _BEST)
    each = _BEST if _BEST * len(best) <= _LINES else 1
    ranked = [design for designs in best.values() for design in designs[:each]][:_LINES]
    if not ranked:
        return None, 0
    short = not all(design.follows for design in ranked)
    table = Table(
        box=box.SIMPLE_HEAD, title=Text("best designs" if len(best) < 2 else "best designs of each NOx weight"),
        title_justify="left", collapse_padding=True, pad_edge=False,
    )  # fmt: skip
    table.add_column("design", justify="right")
    for name in ranked[0].parameters:
        table.add_column(Text(printable(name)), justify="right")
    for head in ("objective\nl/100km", "bound\nl/100km", "gap\n%"):
        table.add_column(head, justify="right", no_wrap=True)
    if short:
        table.add_column("cycle")
    for design in ranked:
        mark = ["" if design.follows else "not followed"] if short else []
        table.add_row(*map(Text, _cells(design) + mark))
    return table, max(0, len(best) - _LINES)


def _cells(ranked: "Ranked") -> list[str]:
    figures = [f"{v:.4f}" if v is not None else "-" for v in (ranked.objective, ranked.bound)]
    gap = "-"
    if ranked.objective is not None and ranked.bound:
        gap = f"{100 * max(ranked.objective / ranked.bound - 1, 0.0):.3f}"
    return [str(ranked.design), *map(_value, ranked.parameters.values()), *figures, gap]


def _value(value: Any) -> str:
    if isinstance(value, float):
        return f"{value:.6g}"
    return printable(value) if isinstance(value, str) else shown(value)
