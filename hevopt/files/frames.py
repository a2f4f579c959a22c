"""Tables of pandas as the bytes of a file: CSV, Parquet, or records for JSON.

A CSV number is the shortest text that reads back to the same bits; what does not exist, NaN and infinity among it,
is an empty cell, null in the others; CSV text that a spreadsheet would run has an apostrophe in front. The same
table gives the same bytes. pandas and pyarrow are imported where a table is made, not before.
"""

import io
import json
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from hevopt.files.shown import printable
from hevopt.files.writing import csv_cells

if TYPE_CHECKING:
    import pandas as pd

# What a column holds -> its type in a table, each with a value for what does not exist.
TYPES: Mapping[type, str] = {int: "Int64", float: "float64", bool: "boolean", str: "object"}


def csv_of(table: "pd.DataFrame", *, header: bool = True) -> bytes:
    """A table as CSV; header: whether its first line names the columns."""
    import pandas as pd

    columns = {}
    for name, values in _finite(table).items():
        if not pd.api.types.is_numeric_dtype(values.dtype):
            values = pd.Series(csv_cells(values), index=values.index, dtype=object)
        columns[name] = values
    names = csv_cells(map(printable, columns)) if header else False
    plain = pd.DataFrame(columns, index=table.index)
    text: str = plain.to_csv(index=False, header=names, lineterminator="\n")
    return text.encode()


def parquet_of(tables: Iterable["pd.DataFrame"], about: Mapping[str, Any] | None = None) -> bytes:
    """Tables of the same columns as the row groups of one Parquet file, what they come from in its metadata.

    tables: one or more
    """
    import pyarrow as pa
    from pyarrow import parquet

    out, writer = io.BytesIO(), None
    for table in tables:
        if writer is None:
            fields = [(name, _arrow_type(dtype)) for name, dtype in table.dtypes.items()]
            told = {} if about is None else {"hevopt": json.dumps(about)}
            schema = pa.schema(fields, metadata=told)
            writer = parquet.ParquetWriter(out, schema)
        whole = pa.Table.from_pandas(_finite(table), schema=schema, preserve_index=False)
        writer.write_table(whole.replace_schema_metadata(told))
    if writer is not None:
        writer.close()
    return out.getvalue()


def records_of(table: "pd.DataFrame") -> list[dict[str, Any]]:
    """The lines of a table as plain Python values, None for what does not exist."""
    finite = _finite(table)
    records: list[dict[str, Any]] = (
        finite.astype(object).where(finite.notna(), None).to_dict("records")
    )
    return records


def _finite(table: "pd.DataFrame") -> "pd.DataFrame":
    """The table with what is no finite number as missing."""
    floats = {
        name: values.where(np.isfinite(values))
        for name, values in table.items()
        if values.dtype == np.float64
    }
    return table.assign(**floats) if floats else table


def _arrow_type(dtype: Any) -> Any:
    """The type of a Parquet column: text where it is no number."""
    import pandas as pd
    import pyarrow as pa

    if pd.api.types.is_bool_dtype(dtype):
        return pa.bool_()
    if not pd.api.types.is_numeric_dtype(dtype):
        return pa.string()
    return pa.float64() if pd.api.types.is_float_dtype(dtype) else pa.int64()
