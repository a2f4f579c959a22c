"""Proofs in files: one who shares no code with hevopt derives them again, and no claim too high gets through."""

import ast
import contextlib
import json
import sys
from pathlib import Path
from unittest import mock

import numpy as np
import pytest
from command_line import call
from proofs import again
from proofs.run import attack

from hevopt import (
    Battery,
    ControlTable,
    Problem,
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
from hevopt.bounds.claim import Proof
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
    bounds["cost"] = plan.cost_kg
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


@pytest.mark.parametrize("count", [50, pytest.param(500, marks=pytest.mark.long)])
def test_proofs_of_a_drive_with_their_claim_raised_are_refused(short, monkeypatch, count):
    """So many of each scope, one thing changed in each; `tests/proofs/run.py` does so by thousands."""
    rng, refused = np.random.default_rng(17), 0
    problem = build_problem(load_architecture("C2"), load_cycle(short / "short.csv"))
    plan = simulate(problem, solve(problem).control)
    for _ in range(2):
        certificate = again.parts(certify(problem, plan))[Proof.COSTATE_PRICES]
        proof, table = proof_of(plan, certificate), table_arrays(problem)
        proof["table_sha256"] = digest_of(problem)
        bound = again.CHECKER.derived(proof, table)
        for _ in range(count):
            how, wrong, arrays = again.corrupted(rng, proof, table)
            proves = bound
            if how in ("price", "end", "scope"):
                # With other prices, another end or fewer controls another claim may be true.
                with contextlib.suppress(ValueError, KeyError):
                    proves = max(bound, again.CHECKER.derived(wrong, arrays))
            wrong["bound_kg"] = proves * (1 + 10.0 ** rng.uniform(-15, -1))
            with pytest.raises((ValueError, TypeError)):
                again.CHECKER.judged(wrong, arrays)
            refused += 1
        monkeypatch.setattr(certificate_module, "split_of", lambda problem: None)
    assert refused == 2 * count


@pytest.mark.parametrize(("name", "lost"), [("costate", 1e-10), ("lower-bound", 0.08)])
def test_the_proof_is_as_good_as_the_bound(tool, short, name, lost, capsys):
    path = short / f"{name}.proof.json"
    assert tool.main([str(path)]) == 0
    assert capsys.readouterr().out.startswith(f"{path.name}: proven, ")
    proof, own_kg = json.loads(path.read_text()), json.loads((short / "bounds.json").read_text())
    assert own_kg[name] * (1 - lost) < proof["bound_kg"] <= own_kg[name]


def test_a_changed_table_is_refused(tool, short, tmp_path, capsys):
    told = json.loads((short / "costate.proof.json").read_text())
    arrays = arrays_of(short, told)
    (tmp_path / "x.proof.json").write_text(json.dumps(told))
    for name, array in arrays.items():
        changed = array.copy()
        changed.flat[0] = not changed.flat[0] if array.dtype == bool else changed.flat[0] + 1
        np.savez(tmp_path / told["table"], **arrays | {name: changed})
        assert tool.main([str(tmp_path / "x.proof.json")]) == 1
        assert "not the one that the proof is for" in capsys.readouterr().out


def test_no_flipped_byte_of_either_file_proves_more_than_is_true(tool, short, tmp_path, capsys):
    rng = np.random.default_rng(5)
    whole = json.loads((short / "costate.proof.json").read_text())
    cost_kg = json.loads((short / "bounds.json").read_text())["cost"]
    table = (short / whole["table"]).read_bytes()
    raised = json.dumps(whole | {"bound_kg": cost_kg * 1.001}).encode()
    path = tmp_path / "x.proof.json"
    for count in range(60):
        text, arrays = bytearray(raised), bytearray(table)
        spoilt = arrays if count % 2 else text
        spoilt[rng.integers(len(spoilt))] ^= 1 << int(rng.integers(8))
        path.write_bytes(text)
        (tmp_path / whole["table"]).write_bytes(arrays)
        status = tool.main([str(path)])
        told = capsys.readouterr().out
        assert told.count("\n") == 1
        if status == 0:  # the claim itself became one that holds
            assert json.loads(path.read_text())["bound_kg"] <= cost_kg
        else:
            assert "NOT proven: " in told


def test_the_tool_is_short_and_needs_numpy_alone():
    lines = again.TOOL.read_text().splitlines()
    assert len(lines) <= 200 and max(map(len, lines)) <= 100
    imported = set()
    for node in ast.walk(ast.parse("\n".join(lines))):
        if isinstance(node, ast.Import):
            imported |= {name.name for name in node.names}
        elif isinstance(node, ast.ImportFrom):
            imported.add(node.module)
    assert imported - set(sys.stdlib_module_names) == {"numpy"}


def curved_problem() -> Problem:
    """Voltage with a bend and resistances that change, charging lossier, switching that takes energy."""
    pack = Battery(
        [0, 0.4, 0.7, 1], [300, 330, 340, 390], [0.9, 0.4, 0.3, 0.5], [0.5, 0.3, 0.4, 0.8], 4e3,
        coulombic_efficiency=0.95, soc_min=0.2, soc_max=0.9,
    )  # fmt: skip
    rng = np.random.default_rng(3)
    power = np.sort(rng.uniform(-2e4, 3e4, (40, 8)), axis=1)
    fuel = np.maximum(0.0, 2e-3 - 4e-8 * power) + (power < 1e4) * 2e-4
    table = ControlTable.from_arrays(
        fuel, power, mode=np.arange(8) % 2, switch_fuel_kg=[[0, 1e-4], [0, 0]],
        switch_energy_j=[[0, 2e3], [0, 0]],
    )  # fmt: skip
    return Problem(table, pack, 0.5, 0.5)


def test_a_battery_whose_resistances_change_is_proven_from_the_table(tool):
    problem = curved_problem()
    plan = simulate(problem, solve(problem).control)
    with mock.patch.object(certificate_module, "LOWER_DP_NODES", (501,)):
        certificate = certify(problem, plan, target_gap=-1.0)
    for kind, alone in again.parts(certificate).items():
        proof = proof_of(plan, alone) | {"table_sha256": digest_of(problem)}
        assert tool.judged(proof, table_arrays(problem)).startswith("proven")
        bound_kg = tool.derived(proof, table_arrays(problem))
        assert bound_kg <= plan.cost_kg
        # By prices the tool's tangents are as good as hevopt's cells, or better.
        if kind is not Proof.LOWER_BOUND_DP:
            own_kg, _ = alone.bound_kg(proof["end_j"])
            assert bound_kg >= own_kg * (1 - 1e-9)
        with pytest.raises(ValueError, match="claimed"):
            tool.judged(proof | {"bound_kg": bound_kg * (1 + 1e-14)}, table_arrays(problem))


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
