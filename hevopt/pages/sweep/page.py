"""The page of a sweep, made from its store alone."""

import base64
import gzip
import json
import tomllib
from math import isfinite
from pathlib import Path
from typing import Any

import numpy as np
from markupsafe import Markup

from hevopt.files.lookup import places_shown
from hevopt.files.shown import printable
from hevopt.pages.render import render
from hevopt.pages.sweep.alerts import alerts
from hevopt.pages.sweep.data import CASES_MAX, DESIGNS_MAX, DesignFigures, Sweep, designs_csv
from hevopt.pages.sweep.drawing import (
    BEST_LINES,
    BEST_LISTED,
    EFFECTS_DRAWN,
    LINES_MAX,
    drawn,
    merit_name,
    plane_of,
    unit_of,
)
from hevopt.pages.sweep.effects import ParameterEffect, effect, is_log, is_numeric
from hevopt.pages.sweep.verdict import Group, groups_of, shown_value, verdict
from hevopt.studies.provenance import code_digest, versions
from hevopt.sweeps.plan.jobs import NOX_WEIGHT, Ending, Failure
from hevopt.sweeps.store.reading import Record
from hevopt.sweeps.store.store import PROVEN

PRUNED_LISTED = 100
# Entries of the store's meta that have a place of their own on the page.
_SHOWN_APART = ("study", "command", "versions", "inputs", PROVEN)


def sweep_page(sweep: Sweep) -> str:
    """The page as HTML, with the sweep's cases or designs inside."""
    figures = sweep.figures
    groups = groups_of(figures)
    effects = [_effects(sweep, group) for group in groups]
    plane, words = plane_of(figures, groups, sweep.pruned)
    table = sweep.cases_csv or designs_csv(figures)
    data = json.dumps(drawn(figures, groups, effects, plane), separators=(",", ":"))
    return render(
        "sweep.html.j2",
        ("sweep.js",),
        _packed(data.encode()),
        sweep=sweep,
        title=f"{'Sizing' if PROVEN in sweep.meta else 'Sweep'} {_study_file(sweep).name or sweep.name}",
        architecture=_architecture(sweep),
        weighted=bool(figures.weight.any()),
        verdict=verdict(sweep, groups),
        alerts=alerts(sweep, groups),
        proven=sweep.meta.get(PROVEN, "").splitlines(),
        groups=groups,
        parameters=[
            (_broken(key), unit_of(key), is_numeric(values))
            for key, values in figures.values.items() if key != NOX_WEIGHT
        ],
        logarithmic=any(is_numeric(of) and is_log(of) for of in figures.values.values()),
        merit=merit_name(figures),
        best=[_line(figures, int(n)) for group in groups if group.weight is not None
              for n in group.ranked[:BEST_LISTED]],
        many_weights=groups[0].weight is None,
        effects=[(g.label, e) for g, found in zip(groups, effects, strict=True) for e in found],
        effect_panels=max(min(len(found), EFFECTS_DRAWN) for found in effects),
        plane=plane,
        plane_words=words,
        pruned=_pruned(sweep),
        failures=[_failure(sweep, record) for record in sweep.tally.failures],
        failures_all=sum(sweep.tally.counts[ending] for ending in (Ending.FAILED, Ending.INFEASIBLE)),
        limits={"best": BEST_LISTED, "pruned": PRUNED_LISTED, "cases": CASES_MAX, "designs": DESIGNS_MAX,
                "lines": LINES_MAX, "best_lines": BEST_LINES, "effects": EFFECTS_DRAWN},
        facts=_facts(sweep),
        inputs=_inputs(sweep),
        computed_by=_entries(sweep.meta.get("versions")),
        versions=versions(),
        same_code=sweep.meta.get("code_digest") == code_digest(),
        table=Markup(base64.b64encode(_packed(table)).decode()),
    )  # fmt: skip


def _study_file(sweep: Sweep) -> Path:
    return Path(sweep.meta.get("study_file", ""))


def _architecture(sweep: Sweep) -> str | None:
    """The car that the study names, without folders; None where the store has no study that can be read."""
    try:
        named = tomllib.loads(sweep.meta.get("study", "")).get("architecture")
    except tomllib.TOMLDecodeError:
        return None
    return printable(Path(named).name) if isinstance(named, str) else None


def _facts(sweep: Sweep) -> dict[str, str]:
    """What the store knows; the study file by its name, for a page may be handed on and folders are the user's."""
    facts = {k: v for k, v in sweep.meta.items() if k not in _SHOWN_APART}
    if "study_file" in facts:
        facts["study_file"] = _study_file(sweep).name
    return facts


def _inputs(sweep: Sweep) -> list[tuple[str, str]]:
    """Files and their digests, each from the study's folder on."""
    folder = _study_file(sweep).parent
    names = places_shown(map(Path, sweep.inputs), folder)
    return [(names[Path(file)], digest) for file, digest in sweep.inputs.items()]


def _entries(text: str | None) -> dict[str, str]:
    """Name -> text of a JSON object; empty where a store has none."""
    found = json.loads(text) if text else {}
    return {str(name): str(value) for name, value in found.items()}


def _packed(contents: bytes) -> bytes:
    return gzip.compress(contents, 6, mtime=0)


def _broken(key: str) -> Markup:
    """A key path on as many lines as it has parts."""
    return Markup(".<br>").join(key.split("."))


def _number(value: float) -> float | None:
    return None if np.isnan(value) else float(value)


def _line(figures: DesignFigures, n: int) -> dict[str, Any]:
    """A design as a line of a table."""
    return {
        "design": int(figures.number[n]),
        "weight": float(figures.weight[n]),
        "values": _values(figures, n),
        "objective": _number(figures.objective[n]),
        "fuel": _number(figures.fuel[n]),
        "nox": _number(figures.nox[n]),
        "bound": _number(figures.bound[n]),
        "gap": _number(figures.gap_percent[n]),
        "strategy": figures.strategy[n],
        "status": figures.status[n],
    }


def _values(figures: DesignFigures, n: int) -> list[tuple[str, float | None]]:
    """Text of every parameter but the NOx weight, and its number where it is one."""
    found = [values[n] for key, values in figures.values.items() if key != NOX_WEIGHT]
    return [(shown_value(v), float(v) if is_numeric([v]) else None) for v in found]


def _pruned(sweep: Sweep) -> list[dict[str, Any]]:
    """The first of the discarded designs, those first that came closest to being solved."""
    place = {int(number): n for n, number in enumerate(sweep.figures.number)}
    first = sorted(sweep.pruned, key=lambda p: (p.excess, p.design))[:PRUNED_LISTED]
    return [
        {
            "design": p.design,
            "weight": float(sweep.figures.weight[place[p.design]]),
            "values": _values(sweep.figures, place[p.design]),
            "bound": p.bound,
            "incumbent": p.incumbent,
            "objective": p.objective,
            "above": 100 * p.excess if isfinite(p.excess) else None,
        }
        for p in first
    ]


def _failure(sweep: Sweep, record: Record) -> dict[str, Any]:
    parameters = {k: v for k, v in record.parameters.items() if k != NOX_WEIGHT}
    failure = record.failure or Failure("no reason given")
    return {
        "design": record.design,
        "weight": record.nox_weight,
        "parameters": ", ".join(f"{key} {shown_value(v)}" for key, v in parameters.items()),
        "cycle": record.cycle,
        "strategy": record.strategy,
        "outcome": str(record.ending),
        "error": printable(failure.headline),
        "details": failure.details,
    }


def _effects(sweep: Sweep, group: Group) -> list[ParameterEffect]:
    """Effects of the parameters that vary, the largest share first; none over weights that do not compare."""
    if group.weight is None:
        return []
    figures, found = sweep.figures, []
    chosen = group.ranked[~figures.short[group.ranked]]
    place = {int(figures.number[n]): n for n in group.members}
    pruned = [(place[p.design], p.bound) for p in sweep.pruned if p.design in place]
    for key, values in figures.values.items():
        own = [values[n] for n in chosen.tolist()]
        others = [(values[n], bound) for n, bound in pruned]
        if own and len({*own, *(value for value, _ in others)}) > 1:
            found.append(effect(key, own, figures.merit[chosen], others))
    return sorted(found, key=lambda e: -(e.share or 0.0))
