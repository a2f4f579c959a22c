"""A short run of the fuzzer (tests/fuzzing/run.py has the long one), and proof that it would notice a fault."""

import sys

import pytest
from fuzzing.run import fuzz
from fuzzing.runner import Seen, fault_of, run

CASES = range(40)


@pytest.mark.skipif(sys.platform == "win32", reason="forks")
def test_spoilt_files_give_a_result_or_one_message():
    faults, statuses = fuzz(1, CASES, None, rare=False)
    assert not faults, "\n".join(faults)
    assert sum(statuses.values()) == len(CASES)
    assert any(name.endswith(" 0") for name in statuses)
    assert any(name.endswith(" 2") for name in statuses)


@pytest.mark.parametrize(
    ("seen", "words"),
    [
        (Seen(1, "", "Traceback (most recent call last):", 0.1, 1), "status 1"),
        (Seen(2, "", "Traceback (most recent call last):", 0.1, 1), "a traceback"),
        (Seen(2, "", "", 0.1, 1), "without a message"),
        (Seen(0, "", "", 11.0, 1), "took 11.0 s"),
        (Seen(0, "", "", 0.1, 1, 301.0), "did not end within 300 s"),
        (Seen(0, "", "", 0.1, 3_000_000_000), "3.00 GB"),
        (Seen(-9, "", "", 0.1, 1), "status -9"),
        (Seen(2, "", "hevopt: error: \x1b[2J", 0.1, 1), "control characters"),
    ],
)
def test_a_fault_is_noticed(seen, words):
    assert words in fault_of(seen)


def test_a_good_answer_is_no_fault(tmp_path):
    seen = run(["cycles"], tmp_path)
    assert fault_of(seen) is None and seen.status == 0 and "nedc" in seen.out
    seen = run(["run", "./none.toml"], tmp_path)
    assert fault_of(seen) is None and seen.status == 2 and "does not exist" in seen.err
