"""A sweep's store as a table of pandas."""

import io

import pandas as pd
import pytest
from small_stores import DESIGNS, PLAN, ok
from sweep_runs import table

import hevopt
from hevopt.sweeps.plan.jobs import Failure, Result
from hevopt.sweeps.plan.prune import Pruned
from hevopt.sweeps.store import frames
from hevopt.sweeps.store.export import cases_csv
from hevopt.sweeps.store.reading import open_to_read
from hevopt.sweeps.store.store import open_store


@pytest.fixture
def path(tmp_path):
    """A store with a case that is ok, one that failed, and two of a pruned design."""
    designs = [(0, {"a.b": 1, "c.d": "x"}), (1, {"a.b": 2.5, "c.d": "=y"})]
    path = tmp_path / "s.sqlite"
    with open_store(path) as store:
        store.begin({"study": ""}, designs, PLAN)
        store.add([ok("0dp"), Result("0ecms", "failed", None, Failure("no plan"), 0.25)])
        store.prune([Pruned(1, 3.5, 0, 3.0)])
    return path


def test_a_store_has_a_line_per_case_with_parameters_and_figures(path):
    frame = hevopt.read_sweep(path)
    assert frame["outcome"].tolist() == ["ok", "failed", "pruned", "pruned"]
    assert frame["a.b"].tolist() == [1.0, 1.0, 2.5, 2.5] and frame["c.d"].tolist()[-1] == "=y"
    assert frame["fuel_l_per_100km"].tolist()[0] == 1 / 3
    assert frame["fuel_l_per_100km"].isna().tolist() == [False, True, True, True]
    assert frame["incumbent"].tolist()[2:] == [0, 0] and frame["incumbent"].dtype == "Int64"
    assert frame["error"].tolist()[1] == "no plan" and frame["case_s"].tolist()[:2] == [0.5, 0.25]
    assert frame["design"].tolist() == [0, 0, 1, 1]


def test_parts_of_a_store_are_the_whole(path, monkeypatch):
    whole, text = hevopt.read_sweep(str(path)), table(path)
    monkeypatch.setattr(frames, "_GROUP", 1)
    pd.testing.assert_frame_equal(hevopt.read_sweep(path), whole)
    assert table(path) == text and text[-1][5] == "'=y"


def test_what_is_exported_reads_back_as_the_same_table(path):
    with open_to_read(path) as reader:
        read = pd.read_csv(io.BytesIO(cases_csv(reader)))
    frame = hevopt.read_sweep(path)
    assert list(read) == list(frame)
    for name in frame.select_dtypes("float64"):
        assert read[name].dropna().tolist() == frame[name].dropna().tolist()


def test_a_store_without_results_has_its_cases_and_types(tmp_path):
    path = tmp_path / "s.sqlite"
    with open_store(path) as store:
        store.begin({"study": ""}, [], [])
    assert hevopt.read_sweep(path).empty
    with open_store(path) as store:
        store.begin({"study": ""}, DESIGNS, PLAN)
    frame = hevopt.read_sweep(path)
    assert frame["outcome"].tolist() == ["missing"] * 4 and frame["a"].tolist() == [
        0.1,
        0.1,
        0.2,
        0.2,
    ]
    assert frame["nox_weight"].dtype == "float64"


def test_no_store_is_one_message(tmp_path):
    with pytest.raises(hevopt.DataError, match="there is no such store"):
        hevopt.read_sweep(tmp_path / "none.sqlite")
