"""The pages of a forward run, and of how fast cars are: one HTML file each."""

import gzip
import json
from collections.abc import Mapping, Sequence
from typing import Any

from hevopt.forward.performance import (
    DISTANCES_M,
    SPEEDS_KMH,
    SUSTAINED_KMH,
    Performance,
)
from hevopt.output.driven_tables import audit, compared, engine_text, how_text, trace_text
from hevopt.output.performance_tables import MEAN_VALUE_NOTE, NOTE
from hevopt.pages.alert import Alert
from hevopt.pages.forward.drawing import drawn_performance, drawn_run
from hevopt.pages.render import render
from hevopt.studies.driven import DrivenPlan
from hevopt.studies.provenance import digests_shown, files_digests, versions
from hevopt.units import KMH_PER_MPS

_SMALL_RESIDUAL = 1e-9
# From where on an energy stands in the tables, and in no figure is left out.
_TINY_J = 0.5


def driven_page(driven: DrivenPlan, command: str) -> str:
    """The page of a forward run as HTML."""
    run = driven.run
    found = audit(run)
    return render(
        "forward.html.j2",
        ("forward.js",),
        _packed(drawn_run(run)),
        title=f"{run.car.name}, {driven.strategy} on {run.cycle.name}",
        driven=driven,
        run=run,
        back=driven.backward,
        how=how_text(driven),
        compared=compared(driven),
        trace=trace_text(run),
        alerts=_alerts(driven),
        given=[(name, value / 1e3) for name, value in found.items() if value > _TINY_J],
        taken=[(name, -value / 1e3) for name, value in found.items() if value < -_TINY_J],
        handling={
            part: getattr(run.handling, part)._asdict()
            for part in ("driver", "clutch", "shifting", "tyre")
        },
        kmh=KMH_PER_MPS,
        command=command,
        inputs=digests_shown(files_digests([run.car], [run.cycle])),
        versions=versions(),
    )


def performance_page(found: Sequence[Performance], command: str) -> str:
    """The page of how fast cars are as HTML."""
    return render(
        "performance.html.j2",
        ("performance.js",),
        _packed(drawn_performance(found)),
        title="How fast: " + ", ".join(dict.fromkeys(of.car.name for of in found)),
        found=found,
        note=f"{NOTE}; {MEAN_VALUE_NOTE}"
        if any(of.engine_model != "map" for of in found)
        else NOTE,
        speeds=SPEEDS_KMH,
        distances=DISTANCES_M,
        sustained=SUSTAINED_KMH,
        cases=list(dict.fromkeys(case for of in found for case in of.in_gear_s)),
        gears=max(len(of.top_mps) for of in found),
        kmh=KMH_PER_MPS,
        command=command,
        inputs=digests_shown(files_digests([of.car for of in found], [])),
        versions=versions(),
    )


def _packed(data: Mapping[str, Any]) -> bytes:
    return gzip.compress(
        json.dumps(data, separators=(",", ":"), allow_nan=False).encode(), 6, mtime=0
    )


def _alerts(driven: DrivenPlan) -> list[Alert]:
    run, left = driven.run, driven.run.quality.violations
    full_s = float(run.full.sum() * run.step_s)
    given = f"all is given, and is too little, for {full_s:.1f} s" if full_s else "never too little"
    neutral = "neutral within 1 % of the fuel's energy, in its window"
    if run.car.electric:
        neutral = "in its window"
    charge = [mark for mark in driven.marks if "charge" in mark]
    maps = [mark for mark in driven.marks if "map" in mark]
    open_ = [
        f"{n}: {r:.0e} of what passed the wheels"
        for n, r in run.residual.items()
        if r > _SMALL_RESIDUAL
    ]
    bound = [
        "of the backward problem: a car that follows the trace to the point; who drives otherwise, within the "
        "tolerance, may burn a little less"
    ]
    return [
        Alert("Trace", bool(left), [trace_text(run)]),
        Alert("Charge", bool(charge), charge or [neutral]),
        Alert("Full load", full_s > 0, [given], grave=False),
        Alert("Measured maps", bool(maps), maps or ["never left"]),
        *([Alert("Engine", True, engine_text(run), grave=False)] if engine_text(run) else []),
        Alert("Balances", bool(open_), open_ or ["every component balances to rounding"]),
        *([] if run.car.electric else [Alert("What the bound is", True, bound, grave=False)]),
    ]  # fmt: skip
