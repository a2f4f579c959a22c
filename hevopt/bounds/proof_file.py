"""Proofs as files: what someone who does not trust hevopt needs to derive a bound again.

Two files hold a proof. The table, `NAME.table.npz`: arrays of the controls, of switching and of the battery, in
NumPy's own format. The proof, `NAME.proof.json`: the claim, the prices (or, of the lower-bound DP, nodes and slope,
from which it is computed again), the table's digest, and the plan beside it. `tools/check_proof.py` reads them.

The scope says of what the claim speaks: of the table's controls, or of every split between them. For that the
table holds virtual controls, too, which a bound counts and no plan may choose, and what is taken off every cost of
a step (virtual.py). Who checks the proof trusts these arrays as he trusts the others: that they stand for what lies
between the levels is shown in hevopt's own code, from the laws of the car, and not in the file.

The digest is SHA-256 over the arrays by name, in alphabetic order, each as "name dtype shape" and its bytes.
What is claimed is the certificate's bound less its own rounding allowance twice more, as who checks it rounds as
well; of the lower-bound DP less what the slope of its relaxation counts for a cell of its grid, and a millionth, as
moves are bounded there in another way.
"""

import hashlib
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hevopt.bounds.certificate import Certificate, Proof
from hevopt.bounds.lower_dp import slope_kgpj
from hevopt.bounds.prices import EPSILON
from hevopt.bounds.virtual import split_of
from hevopt.problem.once import once
from hevopt.problem.problem import Problem, Trajectory

FORMAT = 2


def table_arrays(problem: Problem) -> dict[str, NDArray[Any]]:
    """The arrays of a problem that a proof speaks of, by name in alphabetic order.

    cost_kg, power_w, usable: (time, control); mode: (control,); step_s: (time,); switch_*: (mode, mode) or (time,
    mode, mode); of the battery its curves over soc, capacity_as, coulombic_efficiency and window; the start.
    virtual_*: (entry,) step, mode, cost and power of virtual controls; virtual_slack_kg: (time,) what is taken off
    the costs of a step, where these count; all empty where nothing is known of what lies between the levels
    """
    table, pack = problem.table, problem.battery
    arrays = {
        "cost_kg": problem.cost_kg,
        "power_w": table.battery_power_w,
        "usable": table.reject == 0,
        "mode": table.mode,
        "step_s": table.step_s,
        "switch_fuel_kg": table.switch_fuel_kg,
        "switch_energy_j": table.switch_energy_j,
        "switch_allowed": table.switch_allowed,
        "start_mode": np.int64(problem.start_mode),
        "soc_start": np.float64(problem.soc_start),
    }
    arrays |= _virtual_arrays(problem)
    for name in (
        "soc", "open_circuit_v", "discharge_ohm", "charge_ohm", "capacity_as", "coulombic_efficiency",
        "soc_min", "soc_max",
    ):  # fmt: skip
        arrays[name] = np.asarray(getattr(pack, name), dtype=np.float64)
    return {name: np.asarray(arrays[name], order="C") for name in sorted(arrays)}


def _virtual_arrays(problem: Problem) -> dict[str, NDArray[Any]]:
    split, none = split_of(problem), np.zeros(0)
    if split is None:
        own = none.astype(np.int64), none.astype(np.int64), none, none, none
    else:
        step, control, cost_kg, power_w, slack_kg = split.virtual
        own = step, problem.table.mode[control], cost_kg, power_w, slack_kg
    names = "step", "mode", "cost_kg", "power_w", "slack_kg"
    return {f"virtual_{name}": values for name, values in zip(names, own, strict=True)}


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
        "plan_cost_kg": plan.cost_kg,
        "plan": plan.control.tolist(),
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
