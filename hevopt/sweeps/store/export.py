"""The cases of a store as a table in a file: CSV, or Parquet where pyarrow is installed."""

from pathlib import Path

from hevopt.errors import DataError
from hevopt.files.frames import csv_of, parquet_of
from hevopt.files.writing import check_writable, write_whole
from hevopt.sweeps.plan.jobs import Ending
from hevopt.sweeps.store.frames import frames_of
from hevopt.sweeps.store.reading import Reader


def check_export(path: Path) -> None:
    """DataError, before anything runs, where a table could not be written to this file."""
    if path.suffix not in (".csv", ".parquet"):
        raise DataError(f"--export {path}: a file ending in .csv or .parquet is needed")
    check_writable(path)
    if path.suffix == ".parquet":
        try:
            import pyarrow  # noqa: F401
        except ImportError:
            raise DataError(
                '--export to Parquet needs pyarrow; run: pip install "hevopt[parquet]", or export to a '
                ".csv file"
            ) from None


def export(reader: Reader, path: Path) -> int:
    """Write a line per case, by design, cycle and strategy, parameters and figures as columns; how many lines.

    The columns are those of `read_sweep`. The text is the same whatever ran the sweep, apart from case_s.
    """
    check_export(path)
    write_whole(path, cases_csv(reader) if path.suffix == ".csv" else parquet_of(frames_of(reader)))
    counts = reader.counts()
    return sum(counts[ending] for ending in Ending)


def cases_csv(reader: Reader) -> bytes:
    """The table that `export` writes to a .csv file."""
    return b"".join(csv_of(part, header=n == 0) for n, part in enumerate(frames_of(reader)))
