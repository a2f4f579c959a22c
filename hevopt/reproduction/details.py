"""Tables beside the sections: energies, the calibration curve, the spread of NOx, fuel against the cut of NOx."""

from collections.abc import Sequence
from itertools import pairwise

from hevopt.reproduction.cases import CUTS_PERCENT, Reproduction
from hevopt.reproduction.energies import Balance
from hevopt.reproduction.members import Member, least_penalty
from hevopt.reproduction.published import HYBRIDS, STATEMENTS, Statement
from hevopt.reproduction.verdicts import markdown, signed
from hevopt.units import KMH_PER_MPS

# Points of fuel within which members of a curve count as equals.
_NEAR_LEAST_FUEL = 2.0
_NOT_ENERGIES = ("engine_efficiency_percent", "fuel_l_per_100km")


def balances(found: Reproduction) -> str:
    """Energies of every car, what of the braking is recovered, and the fuel that it comes to."""
    energies = [name for name in Balance._fields if name not in _NOT_ENERGIES]
    heads = ["kJ/km", *(name.replace("_", " ") for name in energies), "engine efficiency, %",
             "recovered of braking, %", "fuel, l/100 km"]  # fmt: skip
    rows = []
    for car, balance in found.balances.items():
        share = 100 * balance.recovered / balance.braking
        cells = [_whole(getattr(balance, name)) for name in energies]
        rows.append([car, *cells, f"{balance.engine_efficiency_percent:.1f}", f"{share:.0f}",
                     f"{balance.fuel_l_per_100km:.3f}"])  # fmt: skip
    text = (
        "Where the energy of ours goes (A `baseline`, B `start_stop`, the others "
        "`conventional`). Traction and braking: at the wheels; recovered: taken by the battery "
        "at its terminals meanwhile; idle fuel: burnt at standstill, a part of the running fuel; "
        "start fuel: that of engine starts beside it; end charge: what charge left beyond the "
        "start's is worth in fuel; engine efficiency: its mean while it burns. Running and start "
        "fuel less end charge are the fuel of the other tables, in the last column."
    )
    return text + "\n\n" + markdown(heads, "l" + "r" * (len(heads) - 1), rows)


def _whole(value: float) -> str:
    return f"{round(value):d}"  # an int has no -0


def members_of(car: str, found: Reproduction) -> list[Member]:
    """The calibrated member and those of the curve."""
    return [found.calibrated[car], *found.curves[car]]


def curves(found: Reproduction) -> str:
    """The calibration curve, the calibrated members, and where it passes the published fuel."""
    rows = []
    for members in zip(*(found.curves[car] for car in HYBRIDS), strict=True):
        rows.append([f"{members[0].threshold_w / 1e3:g}", *_changes(members)])
    calibrated = [found.calibrated[car] for car in HYBRIDS]
    rows.append(["calibrated", *_changes(calibrated)])
    heads = ["electric below, kW"]
    heads += [f"{car} {what}, %" for car in HYBRIDS for what in ("fuel", "NOx")]
    at = "; ".join(
        f"{car} {m.threshold_w / 1e3:.2f} kW, {m.threshold_mps * KMH_PER_MPS:.0f} km/h, {m.threshold_soc:.2f}"
        for car, m in zip(HYBRIDS, calibrated, strict=True)
    )
    text = (
        "The calibration curve of `conventional`: change against A over the power threshold "
        "below which the car drives electrically, every kW, at the calibrated speed and charge. The "
        "calibration itself tries other, finer thresholds, all three together; what it takes, the "
        f"`conventional` of this page, is the last row (up to a power and a speed, above a state of charge: {at})."
    )
    passes = [f"- {s.cars[0]}: {_passes(found, s)}" for s in STATEMENTS if s.section == 2]
    return "\n\n".join(
        [
            text,
            markdown(heads, "r" * len(heads), rows),
            _starred_members(found),
            "Where it passes the published fuel:",
            "\n".join(passes),
        ]
    )


def _changes(members: Sequence[Member]) -> list[str]:
    pairs = (
        (signed(m.fuel_percent) + ("" if m.neutral else "*"), signed(m.nox_percent))
        for m in members
    )
    return [cell for pair in pairs for cell in pair]


def _starred_members(found: Reproduction) -> str:
    rows = [
        [
            car,
            f"{m.threshold_w / 1e3:g}",
            signed(m.surplus_percent),
            signed(m.fuel_percent),
            signed(m.driven_percent),
        ]
        for car in HYBRIDS
        for m in members_of(car, found)
        if not m.neutral
    ]
    heads = ["starred", "electric below, kW", "end charge off, % of the fuel's energy",
             "fuel as above, %", "fuel as driven, %"]  # fmt: skip
    return markdown(heads, "lrrrr", rows) if rows else "No member is starred."


def _passes(found: Reproduction, statement: Statement) -> str:
    car = statement.cars[0]
    middle, places = (statement.low + statement.high) / 2, []
    for before, after in pairwise(found.curves[car]):
        low, high = sorted((before.fuel_percent, after.fuel_percent))
        if low <= middle < high:
            places.append(_between(before, after, middle))
    least = min((m for m in members_of(car, found) if m.neutral), key=lambda m: m.fuel_percent)
    where = "; ".join(places) or "nowhere"
    return (
        f"{middle:g} % {where}. Least fuel of neutral members, the calibrated one among them: "
        f"{signed(least.fuel_percent)} % at {least.threshold_w / 1e3:.2f} kW."
    )


def _between(before: Member, after: Member, fuel_percent: float) -> str:
    """Where two neighbours of the curve pass a change of fuel, and what they are."""
    share = (fuel_percent - before.fuel_percent) / (after.fuel_percent - before.fuel_percent)
    kw = (before.threshold_w + share * (after.threshold_w - before.threshold_w)) / 1e3
    nox = before.nox_percent + share * (after.nox_percent - before.nox_percent)
    ends = " and ".join(
        f"{m.threshold_w / 1e3:g} kW ({signed(m.fuel_percent)}"
        + (" %)" if m.neutral else f" %*, as driven {signed(m.driven_percent)} %)")
        for m in (before, after)
    )
    stars = sum(not m.neutral for m in (before, after))
    only = ("", ", one of them not neutral", ", both not neutral")[stars]
    return f"at {kw:.1f} kW with NOx {signed(nox)} %, by interpolation between {ends}{only}"


def nox_spread(found: Reproduction) -> str:
    """How much NOx differs among members whose fuel hardly does."""
    spreads = []
    for car in HYBRIDS:
        neutral = [m for m in members_of(car, found) if m.neutral]
        least = min(m.fuel_percent for m in neutral)
        near = [m.nox_percent for m in neutral if m.fuel_percent <= least + _NEAR_LEAST_FUEL]
        spreads.append(f"{car} {signed(min(near))} to {signed(max(near))} %")
    return (
        "Among the neutral members of the table in section 2, the calibrated ones included, that burn at most "
        f"{_NEAR_LEAST_FUEL:g} points more than the best, NOx is anywhere in: "
        f"{'; '.join(spreads)}."
    )


def trade_off(found: Reproduction) -> str:
    """What the whole family of nox_cut can do, against conventional."""
    rows = []
    for cut in CUTS_PERCENT:
        penalties = [least_penalty(found.families[car], cut) for car in HYBRIDS]
        rows.append([f"{cut:g}", *("-" if p is None else signed(p) for p in penalties)])
    heads = ["NOx cut by at least, %", *(f"{car} fuel, %" for car in HYBRIDS)]
    text = (
        "The least that the family's neutral members, as shipped, change fuel against "
        "`conventional` for a cut of NOx against it (-: none cuts so much; a cut "
        "counts as it is printed, to 0.1 points). The penalty follows "
        "from how far one cuts:"
    )
    return text + "\n\n" + markdown(heads, "r" * len(heads), rows)
