"""Proofs in files: one who shares no code with hevopt derives them again, and no claim too high gets through."""

import contextlib
import json
from pathlib import Path
from unittest import mock

import numpy as np
import pytest
from command_line import call
from proofs import again
from proofs.run import attack

from hevopt import (
    build_problem,
    certify,
    load_architecture,
    load_cycle,
    simulate,
    solve,
    write_proof,
)
from hevopt.bounds import certificate as certificate_module
from hevopt.bounds import virtual
from hevopt.bounds.certificate import Proof
from hevopt.bounds.proof_file import digest_of, proof_of, table_arrays


@pytest.fixture(scope="module")
def tool():
    return again.CHECKER


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
    by_kind = again.parts(certificate)
    bounds = {}
    for kind in (Proof.COSTATE_PRICES, Proof.LOWER_BOUND_DP):
        name = kind.split()[0]
        write_proof(folder, name, plan, by_kind[kind])
        bounds[name] = by_kind[kind].bound_kg(plan.end_j)[0]
    (folder / "bounds.json").write_text(json.dumps(bounds))
    return folder


def arrays_of(folder: Path, proof: dict) -> dict:
    with np.load(folder / proof["table"]) as file:
        return {name: file[name] for name in sorted(file.files)}


@pytest.mark.parametrize("block", range(4))
def test_random_proofs_are_derived_again_and_none_lies_above_a_plan_or_is_raised(block):
    assert attack(range(40 * block, 40 * block + 40), parts=["checker"]) == []


def test_the_attack_would_find_a_checker_that_takes_any_claim(monkeypatch):
    monkeypatch.setattr(again.CHECKER, "require", lambda holds, reason: None)
    assert any("accepted with its claim raised" in f for f in attack(range(4), parts=["checker"]))


def test_the_attack_would_find_virtual_controls_that_cost_too_much(monkeypatch):
    nodes = virtual.nodes_of

    def dear(*arguments):
        kg, watts, there = nodes(*arguments)
        return kg + 0.3 * abs(kg), watts, there

    monkeypatch.setattr(virtual, "nodes_of", dear)
    faults = attack(range(0, 40), parts=["split", "checker"])
    assert any("above a plan" in fault and "derived" in fault for fault in faults)
    assert any("between levels" in fault for fault in faults)


def test_proofs_of_a_drive_with_their_claim_raised_are_refused(short, monkeypatch):
    """Fifty of each scope, one thing changed in each; `tests/proofs/run.py` does so by thousands."""
    rng, refused = np.random.default_rng(17), 0
    problem = build_problem(load_architecture("C2"), load_cycle(short / "short.csv"))
    plan = simulate(problem, solve(problem).control)
    for _ in range(2):
        certificate = again.parts(certify(problem, plan))[Proof.COSTATE_PRICES]
        proof, table = proof_of(plan, certificate), table_arrays(problem)
        proof["table_sha256"] = digest_of(problem)
        bound = again.CHECKER.derived(proof, table)[0]
        for _ in range(50):
            how, wrong, arrays = again.corrupted(rng, proof, table)
            proves = bound
            if how in ("price", "end", "scope"):
                # With other prices, another end or fewer controls another claim may be true.
                with contextlib.suppress(ValueError):
                    proves = max(bound, again.CHECKER.derived(wrong, arrays)[0])
            wrong["bound_kg"] = proves * (1 + 10.0 ** rng.uniform(-15, -1))
            with pytest.raises((ValueError, TypeError)):
                again.CHECKER.judged(wrong, arrays)
            refused += 1
        monkeypatch.setattr(certificate_module, "split_of", lambda problem: None)
    assert refused == 100


@pytest.mark.parametrize(("name", "lost"), [("costate", 1e-10), ("lower-bound", 0.08)])
def test_the_proof_is_as_good_as_the_bound(tool, short, name, lost):
    path = short / f"{name}.proof.json"
    assert tool.check(path).startswith("proven")
    proof, own_kg = json.loads(path.read_text()), json.loads((short / "bounds.json").read_text())
    assert own_kg[name] * (1 - lost) < proof["bound_kg"] <= own_kg[name]


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
