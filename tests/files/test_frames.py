"""Tables of pandas as files: the same text as the plain writer of CSV, inert in spreadsheets, one schema."""

import csv
import io
from math import inf, nan

import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pyarrow import parquet

from hevopt.files.frames import TYPES, csv_of, parquet_of, records_of
from hevopt.files.writing import csv_cells

TEXTS = st.text(st.characters(codec="utf-8"), max_size=12) | st.none()
NUMBERS = st.floats() | st.none()


def table(**columns: tuple[type, list]) -> pd.DataFrame:
    return pd.DataFrame(
        {name: pd.Series(values, dtype=TYPES[kind]) for name, (kind, values) in columns.items()}
    )


@given(
    lines=st.lists(st.tuples(TEXTS, NUMBERS, st.integers(-(2**60), 2**60) | st.none()), max_size=6)
)
@settings(max_examples=100, deadline=None, derandomize=True)
def test_csv_is_that_of_the_plain_writer(lines):
    texts, numbers, whole = ([line[n] for line in lines] for n in range(3))
    plain = io.StringIO()
    writer = csv.writer(plain, lineterminator="\n")
    writer.writerow(["text", "number", "whole"])
    for text, number, count in lines:
        finite = None if number is None or number - number != 0 else number
        writer.writerow(csv_cells([text, finite, count]))
    made = table(text=(str, texts), number=(float, numbers), whole=(int, whole))
    assert csv_of(made).decode() == plain.getvalue()


def test_names_of_columns_are_inert_as_texts_are():
    made = table(**{"=cmd|x": (str, ["@a", "+1", "-3.5"])})
    assert csv_of(made).decode().splitlines() == ["'=cmd|x", "'@a", "+1", "-3.5"]


def test_parts_of_one_table_are_one_file_of_one_schema():
    parts = [
        table(text=(str, [None]), flag=(bool, [None]), whole=(int, [None]), number=(float, [nan])),
        table(text=(str, ["a"]), flag=(bool, [True]), whole=(int, [2]), number=(float, [-inf])),
    ]
    read = parquet.read_table(io.BytesIO(parquet_of(parts, {"from": "x"})))
    assert read.schema.metadata == {b"hevopt": b'{"from": "x"}'}
    assert list(map(str, read.schema.types)) == ["string", "bool", "int64", "double"]
    nothing = dict.fromkeys(("text", "flag", "whole", "number"))
    assert read.to_pylist() == [nothing, {"text": "a", "flag": True, "whole": 2, "number": None}]
    assert parquet_of(parts) == parquet_of(parts)
    whole = b"text,flag,whole,number\n,,,\na,True,2,\n"
    assert csv_of(parts[0]) + csv_of(parts[1], header=False) == whole


def test_records_are_plain_values():
    found = records_of(table(a=(float, [1.5, inf]), b=(int, [3, None]), c=(str, ["x", None])))
    assert found == [{"a": 1.5, "b": 3, "c": "x"}, dict.fromkeys("abc")]
    assert [type(value) for value in found[0].values()] == [float, int, str]


@pytest.mark.parametrize("number", [0.1, 1e-5, 1e16, 123456789.0, 5e-324, -0.0])
def test_numbers_are_the_shortest_that_read_back(number):
    assert csv_of(table(x=(float, [number]))).decode() == f"x\n{number!r}\n"
