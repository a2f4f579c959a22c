"""Proofs in files: one who shares no code with hevopt derives them again, and no claim too high gets through."""

import importlib.util
import json
import shutil
from dataclasses import replace
from pathlib import Path
from unittest import mock

import numpy as np
import pytest
from command_line import call
from proofs.draw import draw
from proofs.exact import every_plan

from hevopt import (
    HevoptError,
    build_problem,
    certify,
    load_architecture,
    load_cycle,
    simulate,
    solve,
    write_proof,
)
from hevopt.bounds import certificate as certificate_module
from hevopt.bounds.certificate import Certificate, Proof

TOOL = Path(__file__).parents[2] / "tools" / "check_proof.py"
EPSILON = float(np.finfo(float).eps)


@pytest.fixture(scope="module")
def tool():
    spec = importlib.util.spec_from_file_location("check_proof", TOOL)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def short(tmp_path_factory):
    """A folder with proofs of C2 on a drive of a minute and a half, by prices and by a small lower-bound DP."""
    folder = tmp_path_factory.mktemp("proofs")
    drive = folder / "short.csv"
    speed = np.interp(range(91), [0, 8, 25, 45, 60, 70, 80, 90], [0, 0, 50, 50, 0, 0, 30, 0])
    rows = "\n".join(f"{second},{kmh:.3f}" for second, kmh in enumerate(speed))
    drive.write_text(f"time_s,speed_kmh\n{rows}\n")
    problem = build_problem(load_architecture("C2"), load_cycle(drive))
    plan = simulate(problem, solve(problem).control)
    with mock.patch.object(certificate_module, "LOWER_DP_NODES", (1001,)):
        certificate = certify(problem, plan, target_gap=-1.0)
    by_kind = parts(certificate)
    bounds = {}
    for kind in (Proof.COSTATE_PRICES, Proof.LOWER_BOUND_DP):
        name = kind.split()[0]
        write_proof(folder, name, plan, by_kind[kind])
        bounds[name] = by_kind[kind].bound_kg(plan.end_j)[0]
    (folder / "bounds.json").write_text(json.dumps(bounds))
    return folder


def parts(certificate: Certificate) -> dict[Proof, Certificate]:
    """Each kind of proof alone."""
    alone = {
        kind: replace(certificate, proofs={kind: lines}, at_least={})
        for kind, lines in certificate.proofs.items()
    }
    return alone | {
        kind: replace(certificate, proofs={}, at_least={kind: b})
        for kind, b in certificate.at_least.items()
    }


def arrays_of(folder: Path, proof: dict) -> dict:
    with np.load(folder / proof["table"]) as file:
        return {name: file[name] for name in sorted(file.files)}


@pytest.mark.parametrize("block", range(4))
def test_random_proofs_are_derived_again_and_none_lies_above_a_plan(tool, tmp_path, block):
    checked = dict.fromkeys(Proof, 0)
    for seed in range(40 * block, 40 * block + 40):
        problem = draw(seed)
        try:
            plan = simulate(problem, solve(problem, "dp", nodes=301).control)
        except HevoptError:
            continue
        with mock.patch.object(certificate_module, "LOWER_DP_NODES", (301,)):
            certificate = certify(problem, plan, target_gap=-1.0)
        plans = every_plan(problem)
        for kind, alone in parts(certificate).items():
            path = write_proof(tmp_path, "x", plan, alone)
            proof = json.loads(path.read_text())
            bound, cost, _ = tool.derived(proof, arrays_of(tmp_path, proof))
            assert tool.check(path).startswith("proven"), (seed, kind)
            assert cost == pytest.approx(plan.cost_kg, rel=1e-12, abs=1e-300)
            least = min(kg for kg, end_j, _ in plans if end_j >= proof["end_j"])
            assert bound <= least + 4 * len(problem.table.step_s) * EPSILON * abs(least), (
                seed,
                kind,
            )
            checked[kind] += 1
    assert (
        min(
            checked[kind]
            for kind in (Proof.ONE_MULTIPLIER, Proof.COSTATE_PRICES, Proof.LOWER_BOUND_DP)
        )
        > 15
    )


@pytest.mark.parametrize(("name", "lost"), [("costate", 1e-10), ("lower-bound", 0.08)])
def test_the_proof_is_as_good_as_the_bound(tool, short, name, lost):
    path = short / f"{name}.proof.json"
    assert tool.check(path).startswith("proven")
    proof, own_kg = json.loads(path.read_text()), json.loads((short / "bounds.json").read_text())
    assert own_kg[name] * (1 - lost) < proof["bound_kg"] <= own_kg[name]


def test_a_claim_raised_is_refused(tool, short, tmp_path):
    told = json.loads((short / "costate.proof.json").read_text())
    shutil.copy(short / told["table"], tmp_path)
    bound, _, _ = tool.derived(told, arrays_of(short, told))
    rng = np.random.default_rng(1)
    path = tmp_path / "x.proof.json"
    for n in range(60):
        wrong = told | {"bound_kg": bound * (1 + 10.0 ** rng.uniform(-15, -1))}
        price = list(told["price_kgpj"])
        place = int(rng.integers(len(price)))
        if n % 6 == 1:
            price[place] *= 1 + float(rng.uniform(-0.5, 0.5))
        elif n % 6 == 2:
            price[place] = [float("nan"), -price[place], float("inf")][n % 3]
        elif n % 6 == 3:
            price = price[:-1]
        elif n % 6 == 4:
            price = [1.2 * p for p in price]
        elif n % 6 == 5:
            wrong["table_sha256"] = wrong["table_sha256"][::-1]
        path.write_text(json.dumps(wrong | {"price_kgpj": price}))
        with pytest.raises(ValueError, match=r"claimed|price|table"):
            tool.check(path)


def test_a_changed_table_is_refused(tool, short, tmp_path):
    told = json.loads((short / "costate.proof.json").read_text())
    arrays = arrays_of(short, told)
    (tmp_path / "x.proof.json").write_text(json.dumps(told))
    for name, array in arrays.items():
        changed = array.copy()
        changed.flat[0] = not changed.flat[0] if array.dtype == bool else changed.flat[0] + 1
        np.savez(tmp_path / told["table"], **arrays | {name: changed})
        with pytest.raises(ValueError, match="not the one that the proof is for"):
            tool.check(tmp_path / "x.proof.json")


def test_a_plan_that_breaks_a_rule_is_refused(tool, short):
    told = json.loads((short / "costate.proof.json").read_text())
    arrays = arrays_of(short, told)
    unusable = int(np.argmin(arrays["usable"][10]))
    for plan, said in (
        (told["plan"][:-1], "one control per step"),
        ([*told["plan"][:10], unusable, *told["plan"][11:]], "control at step 10"),
        ([*told["plan"][:10], -1, *told["plan"][11:]], "control at step 10"),
    ):
        with pytest.raises(ValueError, match=said):
            tool.derived(told | {"plan": plan}, arrays)


def test_compare_writes_proofs_and_the_tool_checks_them(tool, short, tmp_path, monkeypatch, capsys):
    folder = tmp_path / "proofs"
    words = [
        "compare",
        "--architectures",
        "A,C2",
        "--strategies",
        "dp",
        "--cycle",
        str(short / "short.csv"),
    ]
    seen = call(monkeypatch, capsys, *words, "--proof", str(folder))
    assert seen.status == 0
    assert f"2 proofs written to {folder}" in seen.out
    paths = sorted(folder.glob("*.proof.json"))
    assert [path.name for path in paths] == ["short_A_dp.proof.json", "short_C2_dp.proof.json"]
    assert tool.main(map(str, paths)) == 0
    paths[0].write_text("{")
    assert tool.main(map(str, paths)) == 1
    assert "NOT proven" in capsys.readouterr().out


def test_a_folder_that_cannot_be_is_one_message(tmp_path, monkeypatch, capsys):
    (tmp_path / "file").write_text("")
    for place in (tmp_path / "file", tmp_path / "none" / "deep"):
        seen = call(monkeypatch, capsys, "compare", "--proof", str(place))
        assert seen.status == 2
        assert f"--proof {place}" in seen.err and seen.err.count("hevopt: ") == 1
