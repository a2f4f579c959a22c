"""A comparison as a table of pandas."""

import pytest

from hevopt.studies.comparison import Comparison
from hevopt.studies.rows import Row
from hevopt.studies.status import Status


def test_a_comparison_has_the_fields_of_its_rows_as_columns(comparison_of):
    comparison = comparison_of("nedc")
    frame = comparison.to_frame()
    assert list(frame) == ["cycle", *Row.__dataclass_fields__]
    assert set(frame["cycle"]) == {"nedc"} and len(frame) == len(comparison.rows)
    for line, row in zip(frame.to_dict("records"), comparison.rows, strict=True):
        assert line == {"cycle": "nedc", **row.as_dict()}
    best = frame.loc[frame["strategy"] != "dp"].groupby("architecture")["gap_percent"].min()
    assert (best >= 0).all()


@pytest.mark.parametrize("rows", [[], [Row("A", "dp", Status(failure="too steep"))]])
def test_types_are_the_same_without_any_figure(comparison_of, rows):
    frame = Comparison("c", rows).to_frame()
    assert (frame.dtypes == comparison_of("nedc").to_frame().dtypes).all()
    assert frame["fuel_l_per_100km"].isna().all() and frame["engine_starts"].isna().all()
    assert frame["status"].tolist() == ["failed: too steep"] * len(rows)
