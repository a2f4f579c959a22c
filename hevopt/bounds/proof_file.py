"""Proofs as files: what someone who does not trust hevopt needs to derive a bound again.

Two files hold a proof. The table, `NAME.table.npz`: arrays of the controls, of switching and of the battery, in
NumPy's own format. The proof, `NAME.proof.json`: the claim, the prices (or, of the lower-bound DP, nodes and slope,
from which it is computed again), and the table's digest. `tools/check_proof.py` reads them.

The controls are entries, one for each step at which one can be used; `tabulated` marks those that a bound on the
table's own controls counts: all but those that would move more stored energy than the window holds. Where the
scope is every split between the levels, `split` marks those that count, virtual ones among them, which no plan may
choose, and split_slack_kg is taken off every cost of a step (virtual.py). Who checks the proof trusts these arrays
as he trusts the others: that they stand for what lies between the levels is shown in hevopt's own code, from the
laws of the car, and not in the file.

The battery is its curves at points of stored energy, cut to the granted window: U² is linear between two points,
as U is in charge, and a resistance lies between those of the two, so that the lesser is a bound on it.

The digest is SHA-256 over the arrays by name, in alphabetic order, each as "name dtype shape" and its bytes.
What is claimed is the certificate's bound less its own rounding allowance twice more, as who checks it rounds as
well; of the lower-bound DP less what the slope of its relaxation counts for a cell of its grid, and a millionth, as
moves are bounded there in another way.
"""

import hashlib
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hevopt.bounds.bounded import bounded_choices
from hevopt.bounds.certificate import Certificate
from hevopt.bounds.claim import Proof
from hevopt.bounds.lower_dp import slope_kgpj
from hevopt.bounds.prices import EPSILON
from hevopt.bounds.step_prices import CELLS, STRAIGHT
from hevopt.bounds.virtual import split_of
from hevopt.problem.battery import energy_j, states
from hevopt.problem.once import once
from hevopt.problem.problem import Problem, Trajectory

FORMAT = 3
# Share of the most stored energy by which points stand beside an energy that is known.
_NEAR = 1e-13


def table_arrays(problem: Problem) -> dict[str, NDArray[Any]]:
    """The arrays of a problem that a proof speaks of, by name in alphabetic order.

    step, mode, cost_kg, power_w, tabulated, split: (entry,) see above; split_slack_kg, step_s: (time,)
    switch_*: (mode, mode) or (time, mode, mode); start_mode, start_j, coulombic_efficiency: ()
    energy_j, open_circuit_v, discharge_ohm, charge_ohm: (point,) of the battery
    """
    table = problem.table
    arrays: dict[str, Any] = _entry_arrays(problem) | _battery_arrays(problem)
    arrays |= {
        "step_s": table.step_s,
        "switch_fuel_kg": table.switch_fuel_kg,
        "switch_energy_j": table.switch_energy_j,
        "switch_allowed": table.switch_allowed,
        "start_mode": np.int64(problem.start_mode),
        "start_j": np.float64(problem.start_j),
    }
    return {name: np.asarray(arrays[name], order="C") for name in sorted(arrays)}


def _entry_arrays(problem: Problem) -> dict[str, NDArray[Any]]:
    """Usable controls, step by step and in the order of their columns, and after them virtual ones."""
    table, split = problem.table, split_of(problem)
    step, control = np.nonzero(table.reject == 0)
    bounded = bounded_choices(problem)
    tabulated = np.zeros(table.reject.shape, dtype=bool)
    tabulated[bounded.spread(np.arange(bounded.steps)), bounded.control] = True
    cost_kg, power_w = problem.cost_kg[step, control], table.battery_power_w[step, control]
    own, slack_kg = len(step), np.zeros(len(table.step_s))
    if split is not None:
        virtual = split.virtual
        slack_kg = virtual.slack_kg
        step, control = np.append(step, virtual.step), np.append(control, virtual.control)
        cost_kg, power_w = np.append(cost_kg, virtual.cost_kg), np.append(power_w, virtual.power_w)
    return {
        "step": step,
        "mode": table.mode[control],
        "cost_kg": cost_kg,
        "power_w": power_w,
        "tabulated": tabulated[step, control] & (np.arange(len(step)) < own),
        "split": np.full(len(step), split is not None),
        "split_slack_kg": slack_kg,
    }


def _battery_arrays(problem: Problem) -> dict[str, NDArray[Any]]:
    """The curves at their own points within the window and at more, so that each piece can count as one resistance.

    Where resistance changes these are as many as the bounds by prices take; and in any case two very close to each
    energy with which the first step can begin, known as it is.
    """
    pack, inside = problem.battery, problem.battery.within_window()
    ohms = inside.discharge_ohm, inside.charge_ohm
    cells = CELLS if any(np.ptp(ohm) > STRAIGHT * ohm.max() for ohm in ohms) else 1
    even = energy_j(pack, np.linspace(inside.soc[0], inside.soc[-1], cells + 1)[1:-1])
    low, high = inside.energy_j[[0, -1]]
    # Of (mode, mode), or of the first step of (time, mode, mode).
    taken = problem.table.switch_energy_j
    begins = problem.start_j - taken.reshape(-1, *taken.shape[-2:])[0, problem.start_mode]
    begins = np.clip(begins, low, high)
    near = np.concatenate([begins - _NEAR * high, begins + _NEAR * high])
    points = np.unique(np.concatenate([inside.energy_j, even, near]))
    points = points[(points >= low) & (points <= high)]
    curves = states(pack, points)[1:]
    names = "open_circuit_v", "discharge_ohm", "charge_ohm"
    arrays = {"energy_j": points} | dict(zip(names, curves, strict=True))
    return arrays | {"coulombic_efficiency": np.float64(pack.coulombic_efficiency)}


@once
def digest_of(problem: Problem) -> str:
    """SHA-256 of the arrays of a problem, by name."""
    digest = hashlib.sha256()
    for name, array in table_arrays(problem).items():
        digest.update(f"{name} {array.dtype.str} {array.shape}\n".encode() + array.tobytes())
    return digest.hexdigest()


def proof_of(plan: Trajectory, certificate: Certificate) -> dict[str, Any]:
    """The highest bound at a plan's own end charge, as a proof that stands alone but for the table."""
    kind = certificate.bound_kg(plan.end_j)[1]
    if kind is Proof.LOWER_BOUND_DP:
        own = _recursion(plan.problem, certificate)
    else:
        own = _prices(plan, certificate, kind)
    return {
        "format": FORMAT,
        "scope": str(certificate.claim(kind).scope),
        "proof": str(kind),
        **own,
    }


def _prices(plan: Trajectory, certificate: Certificate, kind: Proof) -> dict[str, Any]:
    """The claim of the line that is highest at the plan's own end charge."""
    # Whoever follows the plan again rounds as well.
    rounded_j = 4 * EPSILON * len(plan.control) * float(np.abs(plan.energy_j).max())
    end_j = plan.end_j - rounded_j
    extra_j = end_j - certificate.end_min_j
    line = max(certificate.proofs[kind], key=lambda line: line.value_kg + line.price_kgpj * extra_j)
    bound_kg = line.value_kg + line.price_kgpj * extra_j
    rounding_kg = line.rounding_kg + 4 * EPSILON * (abs(bound_kg) + line.price_kgpj * abs(end_j))
    return {
        "kind": "prices",
        "end_j": end_j,
        "bound_kg": bound_kg - 2 * rounding_kg,
        "price_kgpj": (line.scale * line.shape).tolist(),
    }


def _recursion(problem: Problem, certificate: Certificate) -> dict[str, Any]:
    kind = Proof.LOWER_BOUND_DP
    bound_kg, (nodes, price_kgpj) = certificate.at_least[kind], certificate.recursions[kind]
    low, high = problem.battery.granted_window_j
    slope = slope_kgpj(price_kgpj)
    return {
        "kind": str(kind),
        "end_j": certificate.end_min_j - certificate.end_slack_j,
        "bound_kg": bound_kg - slope * (high - low) / (nodes - 1) - 1e-6 * abs(bound_kg),
        "nodes": nodes,
        "slope_kgpj": slope,
    }
