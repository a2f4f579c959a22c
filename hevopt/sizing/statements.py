"""What a sizing says of its designs, line by line: how they ended, and what is proven of them and between them."""

from hevopt.files.shown import printable, shown
from hevopt.sizing.found import Sizing
from hevopt.sizing.proof.prove import TARGET_GAP


def statements(found: Sizing) -> list[str]:
    """The lines, the same in the terminal and on a page."""
    counts = ", ".join(f"{count} {fate}" for fate, count in found.counts.items() if count)
    lines = [f"{len(found.found)} designs: {counts}"]
    objective, best = found.study.objectives[0], found.best
    if best is not None and best.values is not None and found.least is not None:
        gap = best.values[0] / found.least - 1
        of = "no design of this lattice" if found.lattice else "no design that was tried"
        lines.append(
            f"{of} is below {found.least:.5g} ({objective.name}), certified; the best is {100 * gap:.3f} % above"
        )
    return lines + _proof_lines(found)


def _proof_lines(found: Sizing) -> list[str]:
    """What is proven of the sizes between those tried."""
    best, least = found.best, found.proven
    if best is None or best.values is None or least is None:
        return [] if found.lattice else [*_around_lines(found), found.unproven]
    ranges = found.proofs[0].ranges
    held = [
        f"{printable(key)} = {shown(value)}"
        for key, value in best.design.values.items()
        if key not in ranges
    ]
    listed = ", ".join(
        f"{printable(key)} {low:g} to {high:g}" for key, (low, high) in ranges.items()
    )
    lines = [
        f"no car of {listed}{' with ' + ', '.join(held) if held else ''}{_within(found)} is below {least:.5g} "
        f"({found.study.objectives[0].name}), whatever its strategy and requirements{_apart(found)}; the best is "
        f"{100 * (best.values[0] / least - 1):.2f} % above"
    ]
    for proof in found.proofs:
        end = "" if proof.closed else f": more than {100 * TARGET_GAP:g} %, as far as they got"
        lines.append(
            f"  {printable(proof.cycle)}: without requirements {proof.best_l_per_100km:.4f} is reached, "
            f"{100 * proof.gap:.2f} % above the bound, {proof.boxes} boxes in {proof.seconds:.1f} s{end}"
        )
    return lines


def _around_lines(found: Sizing) -> list[str]:
    """What is known of the lattice around the best design."""
    around, best = found.around, found.best
    if around is None or best is None or best.values is None:
        return []
    listed = "; ".join(
        f"{printable(key)} {', '.join(map(shown, values))}" for key, values in around.values.items()
    )
    held = ", ".join(f"{printable(key)} = {shown(value)}" for key, value in around.held.items())
    of = (
        f"the lattice of {around.designs} designs around the best, not the ranges between ({listed}"
    )
    of += f"; held: {held})" if held else ")"
    if around.least is None:
        return [f"{of}: one of its designs has no bound"]
    return [
        f"{of}: none of it that meets what is asked is below {around.least:.5g} "
        f"({found.study.objectives[0].name}), certified; the best is "
        f"{100 * (best.values[0] / around.least - 1):.3f} % above"
    ]


def _within(found: Sizing) -> str:
    within = found.proofs[0].within
    return f" that meets {' and '.join(map(printable, within))}" if within else ""


def _apart(found: Sizing) -> str:
    apart = found.proofs[0].apart
    return f", and whether it meets {' and '.join(map(printable, apart))} or not" if apart else ""
