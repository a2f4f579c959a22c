"""The page of the real cars, Markdown: every figure in it comes from `hold`, none is typed."""

from collections.abc import Sequence
from itertools import pairwise
from statistics import median

from hevopt.car_files.load import load_architecture
from hevopt.reproduction.validation import held_out
from hevopt.reproduction.validation.cases import Held, fuel
from hevopt.reproduction.validation.laboratory import about
from hevopt.reproduction.validation.parts import CHARGE_PERCENT, below_bound, parts_of
from hevopt.reproduction.verdicts import markdown, signed
from hevopt.studies.rows import NEUTRAL_PERCENT

COMMAND = "hevopt validation --out reports/validation.md"
WANTED_PERCENT = 6.0


def page(held: Sequence[Held], command: str = COMMAND) -> str:
    """The whole page. command: what makes it"""
    ordered = worst_first(held)
    parts = [
        _head(command),
        _verdict(ordered),
        _fuel(ordered),
        held_out.section(ordered),
        _split(ordered),
        _explained(ordered),
        _carried(ordered),
        _changed(ordered),
        _work(ordered),
        _tests(ordered),
    ]
    return "\n\n".join(parts) + "\n"


def worst_first(held: Sequence[Held]) -> list[Held]:
    """By how far the best causal strategy is from the warm car; those without a warm figure last."""
    return sorted(held, key=lambda h: 1.0 if h.off_percent is None else -abs(h.off_percent))


def median_percent(held: Sequence[Held]) -> float | None:
    """Median of how far the best causal strategies are from the warm cars; None where no warm figure is known."""
    found = [abs(h.off_percent) for h in held if h.off_percent is not None]
    return median(found) if found else None


def _head(command: str) -> str:
    return f"""# Real cars, held against the laboratory

Made by `{command}`, every figure computed by it; the same inputs give the same page.

The cars are the files in `architectures/real/`, every figure of them with its source and status; what
laboratories measured stands beside them in `measured.csv`. Fuel is in l/100 km, that of strategies
charge-corrected. **Nothing is fitted to a measured fuel**: where a map is not public a published one is
scaled by the law that the car's file states, and marked an estimate.

*Measured* is the mean of the tests, cold start and all; *warm* is without what the cold start adds, by the
measured bags 1 and 3 (one trace, cold and warm). *Bound*: no plan over the tabulated controls that ends with
the charge of the start burns less. *Rule*: `baseline`, or `conventional` with its parameters chosen on the
cycle. *Causal*: `baseline`, or `a_ecms`, which knows nothing of the cycle. All follow the trace exactly with
a warm engine; a gear that is free may change every second at its cost."""


def _verdict(held: Sequence[Held]) -> str:
    middle = median_percent(held)
    if middle is None:
        return "## Verdict\n\nNo warm figure is known of these tests, so that nothing is compared."
    known = [h for h in held if h.off_percent is not None]
    within = sum(abs(h.off_percent or 0.0) <= WANTED_PERCENT for h in known)
    met = "met" if middle <= WANTED_PERCENT else "**not met**"
    low = sum(map(below_bound, known))
    order = "everywhere" if all(map(in_order, held)) else "**not everywhere**"
    return f"""## Verdict

Best causal strategy against the warm car: median {middle:.1f} % off over {len(known)} cars and cycles,
{within} of them within {WANTED_PERCENT:g} %. Asked was a median of {WANTED_PERCENT:g} %: {met}. Bound, `dp`
and best rule stand in this order {order}.

In {low} of {len(known)} the warm car burnt less than the bound. No strategy of the model can do so: there the
data or the model of the car take too much fuel, by at least what the table says; *Car by car* names
what may be.{held_out.verdict(held_out.judged(held))}"""


def in_order(held: Held) -> bool:
    """Whether the bound is at most what `dp` burns, and that at most what the best rule does, within rounding."""
    found = held.bound_l_per_100km, fuel(held.dp), fuel(held.rule)
    return all(low <= high * (1 + 1e-6) for low, high in pairwise(found))


def _fuel(held: Sequence[Held]) -> str:
    heads = ["car", "cycle", "measured", "warm", "bound", "`dp`", "`ecms`", "rule", "causal",
             "causal against warm, %", "bound against warm, %", "marks"]  # fmt: skip
    rows = [fuel_cells(h) for h in held]
    text = f"""Marks: steps that the car cannot follow and drives with what it has; stored energy at the end
above the start's, of the fuel's, where that is more than {NEUTRAL_PERCENT:g} %."""
    return f"## Fuel, the worst first\n\n{text}\n\n" + markdown(heads, "llrrrrrrrrrl", rows)


def fuel_cells(held: Held) -> list[str]:
    """The cells of a car and cycle in the table of fuel."""
    laboratory = held.laboratory
    warm, off = laboratory.warm_l_per_100km, held.off_percent
    low = None if warm is None else 100 * (held.bound_l_per_100km / warm - 1)
    strategies = (held.dp, held.ecms, held.rule, held.causal)
    return [
        f"`{laboratory.car}`",
        laboratory.cycle,
        f"{laboratory.fuel_l_per_100km:.3f}",
        "-" if warm is None else f"{warm:.3f}",
        f"{held.bound_l_per_100km:.3f}",
        *(f"{fuel(row):.3f}" for row in strategies),
        "-" if off is None else signed(off),
        "-" if low is None else signed(low),
        _marks(held),
    ]


def _marks(held: Held) -> str:
    marks = [f"{held.shortfall_steps} of {held.steps} steps short"] if held.shortfall_steps else []
    for name, row in (("rule", held.rule), ("causal", held.causal)):
        ends = row.delta_energy_percent or 0.0
        marks += [f"{name} ends {signed(ends)} %"] if abs(ends) > NEUTRAL_PERCENT else []
    return ", ".join(marks)


def _split(held: Sequence[Held]) -> str:
    rows = []
    for h in held:
        parts = parts_of(h)
        cold = "not known" if parts.cold is None else signed(parts.cold, 3)
        others = (parts.air_conditioning, parts.load, parts.charge, parts.control, parts.rest)
        cells = [signed(parts.excess, 3), cold, *(signed(part, 3) for part in others)]
        rows.append([f"`{h.laboratory.car}`", h.laboratory.cycle, *cells])
    heads = ["car", "cycle", "measured above bound", "cold start", "air conditioning", "electric load",
             "charge", "control", "rest"]  # fmt: skip
    text = f"""In l/100 km. *Cold start*: by bags 1 and 3; nought on HWFET and US06, which begin warm; a label
does not tell. Bags of a hybrid are not charge-balanced one by one, so that its share is wrong by what moved
between them. *Air conditioning*: off in these three tests, by their rules. *Electric load*: what the load of
another published model of the car or its class adds to the bound, where that is more than the file's (next
table). *Charge*: tests are balanced by their rules within {CHARGE_PERCENT:g} % of the fuel, no figure is
given; fuel of strategies is corrected. *Control*: what the best causal strategy burns beyond the bound.
*Rest*: what no name explains; below nought where the model, with what is named, burns more than the car."""
    return f"## Measured above bound, in parts\n\n{text}\n\n" + markdown(heads, "llrrrrrrr", rows)


def _explained(held: Sequence[Held]) -> str:
    rows = []
    for car in dict.fromkeys(h.laboratory.car for h in held):
        own = [h for h in held if h.laboratory.car == car]
        low = ", ".join(sorted(h.laboratory.cycle for h in own if below_bound(h))) or "nowhere"
        said, loads = about()[car], own[0].loads_w
        load = f"{loads[0]:g} and {loads[1]:g} ({said.source})"
        rows.append([f"`{car}`", load_architecture(car).description, low, said.faults, load])
    heads = ["car", "what it is", "measured below the bound", "named faults of data and model",
             "electric load of the file and of the other model, W"]  # fmt: skip
    text = """What is known to be missing. The Camry and the Insight have maps of their own engines, the Prius of
2001 that of its forerunner's; no complete map of the others' is public here. One that EPA measured on an engine
of their kind stands for it, scaled by displacement."""
    return f"## Car by car\n\n{text}\n\n" + markdown(heads, "lllll", rows)


def _carried(held: Sequence[Held]) -> str:
    rows = []
    for h in held:
        needed, off = h.needed_efficiency, h.off_percent
        if needed is None or off is None:
            continue
        use = h.engine
        cells = [
            f"{use.work_mjpkm:.3f}",
            *(f"{100 * x:.1f}" for x in (use.efficiency, needed, use.best_efficiency)),
        ]
        rows.append([f"`{h.laboratory.car}`", h.laboratory.cycle, signed(off), *cells, carrier(h)])
    heads = ["car", "cycle", "causal against warm, %", "engine's work, MJ/km", "efficiency, %", "needed, %",
             "best of the map, %", "what carries the difference"]  # fmt: skip
    text = f"""Work and efficiency of the engine under the best causal strategy, and the efficiency that would do
this work with the fuel of the warm car. *Map or work*: the car burnt less than the model, and an efficiency
below the map's own best would do: the engine is better away from its best point than its map, or has less to
do. *Work*: not even the best point would do, so that the engine has too much to do. *Losses left out*: the car
burnt more. Within {WANTED_PERCENT:g} % nothing is said."""
    return f"## What carries the difference\n\n{text}\n\n" + markdown(heads, "llrrrrrl", rows)


def carrier(held: Held) -> str:
    """What carries the difference of a car and cycle whose warm fuel is known, from the engine's efficiencies."""
    off, needed = held.off_percent, held.needed_efficiency
    assert off is not None and needed is not None
    if abs(off) <= WANTED_PERCENT:
        return "-"
    if off < 0:
        return "losses left out"
    return "map or work" if needed <= held.engine.best_efficiency else "work"


def _changed(held: Sequence[Held]) -> str:
    rows, said, first = [], {}, []
    for h in held:
        warm = h.laboratory.warm_l_per_100km
        if warm is None:
            continue
        before = h.causal_l_per_100km if h.before is None else h.before.causal_l_per_100km
        first.append(abs(100 * (before / warm - 1)))
        if h.before is None:
            continue
        said[h.laboratory.car] = h.before.changes
        cells = [
            f"{before:.3f}",
            f"{h.causal_l_per_100km:.3f}",
            signed(100 * (before / warm - 1)),
            signed(h.off_percent or 0.0),
        ]
        rows.append([f"`{h.laboratory.car}`", h.laboratory.cycle, *cells])
    heads = [
        "car",
        "cycle",
        "causal before, l/100 km",
        "causal",
        "against warm before, %",
        "against warm, %",
    ]
    if not rows:
        return "## Changed after results were seen\n\nNothing, of these cars."
    text = f"""Figures of the cars' files that were changed after the first results had been seen, each for the
reason said, and to a value that was not chosen by the result. With the files as they were first, the median of
{len(first)} cars and cycles was {median(first):.1f} % off."""
    listed = "\n".join(f"- `{car}`: {'; '.join(changes)}" for car, changes in said.items())
    return f"## Changed after results were seen\n\n{text}\n\n{listed}\n\n" + markdown(
        heads, "llrrrr", rows
    )


def _work(held: Sequence[Held]) -> str:
    rows = []
    for h in held:
        off = 100 * (h.work_mjpkm / h.road_mjpkm - 1)
        cells = [f"{h.work_mjpkm:.4f}", f"{h.road_mjpkm:.4f}", signed(off, 2)]
        rows.append([f"`{h.laboratory.car}`", h.laboratory.cycle, *cells])
    heads = ["car", "cycle", "model, MJ/km", "integral, MJ/km", "difference, %"]
    text = """Positive work at the wheels, of the model and by an integral of coefficients and test weight
that shares no code with it."""
    return f"## Energy at the wheels\n\n{text}\n\n" + markdown(heads, "llrrr", rows)


def _tests(held: Sequence[Held]) -> str:
    rows = []
    for h in held:
        tests = h.laboratory.tests
        said = dict.fromkeys(f"{test.test} [{test.status}], {test.source}" for test in tests)
        cells = [f"{len(tests)}", f"{h.laboratory.spread_percent:.1f}", "; ".join(said)]
        rows.append([f"`{h.laboratory.car}`", h.laboratory.cycle, *cells])
    heads = ["car", "cycle", "tests", "highest less lowest, %", "which"]
    return "## The tests\n\n" + markdown(heads, "llrrl", rows)
