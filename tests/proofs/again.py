"""Proofs derived again by `tools/check_proof.py`, which shares no code with hevopt, and spoilt by raising claims.

Of every problem each kind of proof alone is handed over as its two files would hold it: what is claimed must be
accepted, no bound derived may lie above a plan found by enumeration, and it may differ from hevopt's own by no more
than rounding: below it, as the claim is lowered for that; above it, by prices, only as far as an exact inner
minimum lies above tangents. A proof with something changed that raises its claim must be refused.
"""

import importlib.util
import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from types import ModuleType
from unittest import mock

import numpy as np
from proofs.draw import draw
from proofs.exact import every_plan
from proofs.split import drawn

from hevopt import Certificate, InfeasibleError, Problem, certify, simulate
from hevopt.bounds import certificate as certificate_module
from hevopt.bounds.claim import Proof, Scope
from hevopt.bounds.proof_file import digest_of, proof_of, table_arrays
from hevopt.errors import SolverError
from hevopt.problem.problem import Trajectory
from hevopt.strategies import dp

TOOL = Path(__file__).parents[2] / "tools" / "check_proof.py"
EPSILON = float(np.finfo(float).eps)


def tool() -> ModuleType:
    """The checker as a module of its own."""
    spec = importlib.util.spec_from_file_location("check_proof", TOOL)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


CHECKER = tool()


def parts(certificate: Certificate) -> dict[Proof, Certificate]:
    """Each kind of proof alone."""
    alone = {
        kind: replace(certificate, proofs={kind: lines}, at_least={})
        for kind, lines in certificate.proofs.items()
    }
    return alone | {
        kind: replace(certificate, proofs={}, at_least={kind: bound})
        for kind, bound in certificate.at_least.items()
    }


def proven(problem: Problem, nodes: int) -> Iterator[tuple[Proof, Trajectory, Certificate]]:
    """Kind, plan and certificate of each kind of proof of a problem; nothing where no plan is found."""
    try:
        plan = simulate(problem, dp.solve(problem, nodes=101).control)
        with mock.patch.object(certificate_module, "LOWER_DP_NODES", (nodes,)):
            certificate = certify(problem, plan, target_gap=-1.0)
    except (InfeasibleError, SolverError):
        return  # another part of the attack tells where that is a fault
    for kind, alone in parts(certificate).items():
        yield kind, plan, alone


def again_faults(seed: int, nodes: int = 301) -> list[str]:
    """What is wrong with the proofs of a drawn problem, of its table and of all that lies between levels."""
    problem, faults = draw(seed), []
    plans = [(cost, end) for cost, end, _ in every_plan(problem)]
    for kind, plan, alone in proven(problem, nodes):
        faults += _one(seed, kind, plan, alone, plans)
    coarse, fine = drawn(seed)
    plans = [(cost, end) for cost, end, _ in every_plan(fine)]
    own = [(cost, end) for cost, end, _ in every_plan(coarse)]
    for kind, plan, alone in proven(coarse, nodes):
        continuous = alone.claim(kind).scope is Scope.CONTINUOUS
        if continuous != (kind is not Proof.LOWER_BOUND_DP):
            faults.append(f"{kind} speaks of {alone.claim(kind).scope}")
        faults += _one(seed, kind, plan, alone, plans if continuous else own)
    return faults


def _one(seed, kind, plan, alone, plans) -> list[str]:
    table = table_arrays(plan.problem)
    text = json.dumps(proof_of(plan, alone) | {"table_sha256": digest_of(plan.problem)})
    proof = json.loads(text)
    bound = CHECKER.derived(proof, table)
    own = alone.bound_kg(plan.end_j)[0]
    faults, scale = [], abs(own) + abs(plan.cost_kg)
    if not proof["bound_kg"] <= bound:
        faults.append(f"{kind}: claimed {proof['bound_kg']:.15g} kg, derived {bound:.15g} kg")
    if plan.end_j < proof["end_j"]:
        faults.append(f"{kind}: the plan ends with less than the claim is for")
    if kind is not Proof.LOWER_BOUND_DP and proof["bound_kg"] < own - _rounding_kg(
        alone, kind, scale
    ):
        faults.append(f"{kind}: {own:.15g} kg is claimed as {proof['bound_kg']:.15g} kg")
    for own_kg, end in plans:
        # A bound by prices holds for every end charge, moving with it by the last price.
        price = proof["price_kgpj"][-1] if "price_kgpj" in proof else 0.0
        there = bound + price * (end - proof["end_j"])
        moved = 8 * EPSILON * price * (abs(end) + abs(proof["end_j"]))
        if price == 0 and end < proof["end_j"]:
            continue
        if there > own_kg + 4 * len(plan.control) * EPSILON * abs(own_kg) + moved:
            faults.append(f"{kind}: derived {there:.15g} kg, above a plan of {own_kg:.15g} kg")
            break
    return faults + _spoilt(np.random.default_rng([14, seed]), kind, proof, table, bound, plans)


def _rounding_kg(alone, kind, scale) -> float:
    """What a claim may lie below the bound that it is made of: what rounding is granted there, a few times."""
    lines = alone.proofs[kind]
    greatest = max(line.rounding_kg for line in lines)
    priced = max(line.price_kgpj for line in lines) * abs(alone.end_min_j)
    return 4 * greatest + 64 * EPSILON * (scale + priced)


def _spoilt(rng, kind, proof, table, bound, plans) -> list[str]:
    """A fault where a proof with its claim raised above what is derived, and one thing changed, gets through.

    With other prices, another end or fewer controls more may be proven, and rightly: what then gets through must be
    true of every plan.
    """
    raised = bound + abs(bound) * 10.0 ** rng.uniform(-15, -1) + 1e-300
    if not raised > bound:
        return []
    how, wrong, arrays = corrupted(rng, proof | {"bound_kg": raised}, table)
    try:
        CHECKER.judged(wrong, arrays)
    except Exception:
        return []
    enough = [cost for cost, end in plans if end >= wrong["end_j"]]
    if how in ("price", "end", "scope") and raised <= min(enough, default=np.inf):
        return []
    return [f"{kind}: accepted with its claim raised to {raised:.17g} kg and {how} changed"]


def corrupted(rng, proof, table):
    """What was changed at random, and a proof and a table with that changed."""
    proof, table = dict(proof), dict(table)
    how = str(
        rng.choice(["nothing", "price", "prices", "length", "scope", "table", "digest", "end"])
    )
    if how in ("price", "prices", "length") and "price_kgpj" in proof:
        price = np.array(proof["price_kgpj"])
        place = int(rng.integers(len(price)))
        if how == "price":
            price[place] = rng.choice([price[place] / 2, 2 * price[place], np.nan, -1e-9, np.inf])
        elif how == "prices":
            price, how = price * rng.choice([0.5, 1.001, 2.0, np.nan]), "price"
        else:
            price = price[:-1] if rng.random() < 0.5 else np.append(price, price[-1])
        proof["price_kgpj"] = price.tolist()
    elif how == "scope":
        proof["scope"] = str(rng.choice([*Scope, "everything"]))
    elif how == "table":
        name = str(rng.choice([name for name, array in table.items() if array.size]))
        array = np.array(table[name])
        place = int(rng.integers(array.size))
        array.flat[place] = not array.flat[place] if array.dtype == bool else array.flat[place] + 1
        table[name] = array
    elif how == "digest":
        proof["table_sha256"] = proof["table_sha256"][::-1]
    elif how == "end":
        proof["end_j"] = proof["end_j"] * (1 + 10.0 ** rng.uniform(-9, -1)) + 1.0
    return how, proof, table
