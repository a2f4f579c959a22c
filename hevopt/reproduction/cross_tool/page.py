"""The cross-tool page, Markdown: every figure in it comes from `hold_across`, none is typed."""

from collections.abc import Sequence
from statistics import median

from hevopt.reproduction.cross_tool.held import CrossHeld
from hevopt.reproduction.cross_tool.tool import (
    HYBRID,
    PLAIN,
    constants,
    powertrain,
    template,
    version,
)
from hevopt.reproduction.verdicts import markdown, signed
from hevopt.units import STANDARD_GRAVITY_MPS2

COMMAND = "hevopt validation --fastsim --out reports/cross_tool.md"


def cross_page(held: Sequence[CrossHeld], command: str = COMMAND) -> str:
    """The whole page. command: what makes it"""
    parts = [_head(command), _verdict(held), _wheels(held), _defaults(held), _fuel(held)]
    return "\n\n".join(parts) + "\n"


def _head(command: str) -> str:
    return f"""# The same cars in another tool

Made by `{command}` with FASTSim {version()}
of the National Laboratory of the Rockies; every figure is computed, by it or by hevopt. The cars are the real
ones of `architectures/real/`, on the cycles that [laboratories drove them on](validation.md)."""


def _verdict(held: Sequence[CrossHeld]) -> str:
    worst = max(held, key=lambda h: h.wheels.off_w / h.wheels.highest_w)
    off = max(abs(h.wheels.work_off_percent) for h in held)
    known = [h for h in held if h.fuel is not None]
    text = f"""## Verdict

Told by its own constants, FASTSim asks the wheels for what hevopt asks, step by step: of {len(held)} cars
and cycles the largest difference of any step is {worst.wheels.off_w:.2g} W where
{worst.wheels.highest_w / 1e3:.0f} kW are the most (`{worst.car}`, {worst.cycle}), and the positive work is
the same within {off:.1e} %."""
    if known:
        apart = [100 * (h.fuel.theirs / h.fuel.ours - 1) for h in known if h.fuel is not None]
        speed = [100 * h.fuel.speed / h.fuel.ours for h in known if h.fuel is not None]
        text += f"""

Its fuel lies {signed(min(apart))} to {signed(max(apart))} % from ours, in the median
{signed(median(apart))} %. That its engine's efficiency depends on power alone makes {signed(min(speed))} to
{signed(max(speed))} % of ours; the rest is control and what the parts between engine and wheels do, car by
car below."""
    return text


def _wheels(held: Sequence[CrossHeld]) -> str:
    known = constants()
    rows = []
    for h in held:
        w = h.wheels
        cells = [
            f"{w.work_mjpkm:.4f}",
            f"{w.highest_w / 1e3:.1f}",
            f"{w.off_w:.4f}",
            f"{w.work_off_percent:.1e}",
        ]
        rows.append([f"`{h.car}`", h.cycle, *cells])
    heads = ["car", "cycle", "positive work, MJ/km", "highest power, kW", "largest difference of a step, W",
             "difference in work, %"]  # fmt: skip
    text = f"""FASTSim {version()} computes drag with an air density of {known.density_kgpm3:.5f} kg/m³,
though its results name {known.reported_kgpm3:g}, and with a gravity of {known.gravity_mps2:.2f} m/s²: both
are found by a probe, from the drag and the rolling resistance that it returns. Drag area and rolling
coefficient of each car are told so that these constants give the car's own resistance. A coast-down has a
part linear in speed, which FASTSim has not: it is told as the grade that asks for the same force at each
step."""
    return f"## Energy at the wheels\n\n{text}\n\n" + markdown(heads, "llrrrr", rows)


def _defaults(held: Sequence[CrossHeld]) -> str:
    chassis = template(PLAIN)["chassis"]
    rows = []
    for h in held:
        w = h.wheels
        parts = (w.density_percent, w.gravity_percent, w.linear_percent, w.wheels_percent)
        rows.append([f"`{h.car}`", h.cycle, *(signed(part, 2) for part in parts)])
    heads = [
        "car",
        "cycle",
        "air density, %",
        "gravity, %",
        "no linear part, %",
        "wheels' inertia, %",
    ]
    inertia, radius = (
        chassis[key] for key in ("wheel_inertia_kilogram_square_meters", "wheel_radius_meters")
    )
    text = f"""By how much the positive work at the wheels moves where a car is written down as a user of
FASTSim would: its drag area with the density that is named ({constants().reported_kgpm3:g} kg/m³); its
rolling coefficient with {STANDARD_GRAVITY_MPS2} m/s²; two coefficients, fitted over 15 to 115 km/h, in
place of three; four wheels of {inertia:g} kg m² and {radius:g} m, as in its 2012 Ford Fusion, on top of a
test weight that holds all the inertia there is."""
    return f"## What its own constants are worth\n\n{text}\n\n" + markdown(heads, "llrrrr", rows)


def _fuel(held: Sequence[CrossHeld]) -> str:
    rows, failed = [], []
    for h in held:
        f = h.fuel
        if f is None:
            failed += [f"- `{h.car}`, {h.cycle}: {h.why_not}"] if h.why_not else []
            continue
        cells = [f"{x:.3f}" for x in (h.measured_l_per_100km, f.ours, f.theirs)]
        parts = (f.theirs - f.ours, f.speed, f.work, f.powers, f.other)
        work = [f"{x:.3f}" for x in f.work_mjpkm]
        rows.append(
            [
                f"`{h.car}`",
                h.cycle,
                *cells,
                *(signed(x, 3) for x in parts),
                *work,
                *(signed(x, 3) for x in (f.load, f.engine)),
            ]
        )
    heads = ["car", "cycle", "measured", "hevopt", "FASTSim", "difference", "speed", "work", "powers",
             "other", "engine's work, MJ/km", "theirs", "its load", "its engine"]  # fmt: skip
    loads = [template(name)["pwr_aux_base_watts"] for name in (PLAIN, HYBRID)]
    balance = powertrain(template(HYBRID))["sim_params"]["res_per_fuel_lim"]
    text = f"""In l/100 km, on the HWFET unless cycles are named: warm and steady, control decides least
there and the engine's law most. *hevopt* is its plan of least fuel, *FASTSim* its own control of the same
car; charge at the end, which it balances within {100 * balance:g} % of the fuel, is corrected in both by
what a joule is worth to our plan. The engine is told by the least fuel of each power, at whichever speed;
gears by one efficiency; the machine that drives by its best efficiency of each power, braking by the mean
of our plan, as FASTSim takes the efficiency at no power for generating and gives up where one at another
power is lower; the battery by the round trip of our plan. The alternator of a car without a machine that
drives has the efficiency of the car's file.

The difference in four parts that add up to it. *Speed*: what our engine would save at the best speed of
each of its powers. *Work*: more or less work of the engine, which also carries slip, engine inertia, idle
drag, the detour by generator and motor, and control. *Powers*: the powers at which it is done. *Other*:
starts, changes of gear, charge.

*Its load*, *its engine*: by how much FASTSim's figure moves with the electric load ({loads[0]:g} W;
{loads[1]:g} W of a hybrid) and the engine's efficiencies over power of its own 2012 Ford Fusion, or 2016
Toyota Prius Two of a hybrid."""
    lost = "\n\nFASTSim gives up on:\n\n" + "\n".join(failed) if failed else ""
    return f"## Fuel\n\n{text}\n\n" + markdown(heads, "llrrrrrrrrrrrr", rows) + lost
