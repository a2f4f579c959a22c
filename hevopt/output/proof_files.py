"""Proofs in a folder: two files each, as `bounds/proof_file.py` says, which `tools/check_proof.py` reads."""

import json
import re
from collections import Counter
from collections.abc import Iterable
from io import BytesIO
from pathlib import Path

import numpy as np

from hevopt.bounds.certificate import Certificate
from hevopt.bounds.proof_file import digest_of, proof_of, table_arrays
from hevopt.errors import DataError
from hevopt.files.writing import write_whole
from hevopt.problem.problem import Trajectory

# In place of these a file's name has "_".
_UNSAFE = re.compile(r"[^\w.+-]+")


def check_folder(folder: Path) -> None:
    """DataError where proofs could not be written to a folder; one that is not there is made."""
    try:
        folder.mkdir(exist_ok=True)
    except OSError as error:
        raise DataError(
            f"--proof {folder}: no folder, and none can be made there ({error.strerror}); choose another place"
        ) from None


def write_proofs(folder: Path, proven: Iterable[tuple[str, Trajectory, Certificate]]) -> int:
    """Write a proof for each name, plan and certificate; how many. Of two of one name the second gets a number."""
    names: Counter[str] = Counter()
    for name, plan, certificate in proven:
        names[name] += 1
        number = f"_{names[name]}" if names[name] > 1 else ""
        write_proof(folder, name + number, plan, certificate)
    return names.total()


def write_proof(folder: Path, name: str, plan: Trajectory, certificate: Certificate) -> Path:
    """Write the proof NAME.proof.json of a plan, and the table it speaks of where that is not there yet.

    A table is named by the first digits of its digest, so that the strategies of a car share one; signs that files
    should not have in their names become "_". Raises DataError where a file cannot be written.
    """
    digest = digest_of(plan.problem)
    table = folder / f"{digest[:16]}.table.npz"
    if not table.exists():
        held = BytesIO()
        np.savez_compressed(held, **table_arrays(plan.problem))  # type: ignore[arg-type]
        write_whole(table, held.getvalue())
    told = {"table": table.name, "table_sha256": digest, **proof_of(plan, certificate)}
    path = folder / f"{_UNSAFE.sub('_', name)}.proof.json"
    write_whole(path, json.dumps(told, allow_nan=False, indent=1).encode())
    return path
