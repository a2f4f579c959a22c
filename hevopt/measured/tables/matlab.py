"""MATLAB files to tables: vectors, matrices and the fields of structures, numbers alone.

Levels 4 and 5 are read here, by the published description of the format, because a broken file must end in a
message: readers in compiled code end with a crash (the one of version 7.3 works apart, measured_hdf5.py). Every
length is checked by slicing, which cannot reach outside the file.
"""

import struct
import zlib
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from hevopt.errors import DataError
from hevopt.measured.tables.cells import LARGEST, LISTED, Cells
from hevopt.measured.tables.matlab_cycles import CONVENTION, arranged, array_unit
from hevopt.measured.tables.names import cleaned
from hevopt.measured.tables.rows import CELLS_MAX, ROWS_MAX, Table, listed

_UNPACKED_MAX = 200_000_000
_COLUMNS_MAX = 2_000
# Data types and classes of level 5, precisions of level 4.
_TYPES = {
    1: "i1",
    2: "u1",
    3: "i2",
    4: "u2",
    5: "i4",
    6: "u4",
    7: "f4",
    9: "f8",
    12: "i8",
    13: "u8",
}
_MATRIX, _COMPRESSED = 14, 15
_STRUCTURE, _NUMERIC = 2, range(6, 16)
_COMPLEX = 0x800
_PRECISIONS = ("f8", "f4", "i4", "i2", "u2", "u1")
_BYTE_ORDERS = {b"IM": "<", b"MI": ">"}
# What broken lengths, types and shapes end in.
_BROKEN = (
    ValueError, KeyError, IndexError, TypeError, OverflowError, StopIteration, struct.error, zlib.error,
)  # fmt: skip
# Name -> numbers of any type, or None for a variable that is no matrix of real numbers.
Variables = dict[str, NDArray | None]


def matlab_variables(path: Path, contents: bytes) -> Variables:
    """The variables of a .mat file."""
    if contents.startswith((b"\x89HDF", b"MATLAB 7.3")):
        from hevopt.measured.tables.hdf5 import hdf5_variables

        return hdf5_variables(path, contents)
    try:
        order = _BYTE_ORDERS.get(contents[126:128])
        return _level_5(path, contents, order) if order else _level_4(contents)
    except _BROKEN:
        raise DataError(f"{path}: not a readable .mat file; save it again, or as CSV") from None


def _level_5(path: Path, contents: bytes, order: str) -> Variables:
    variables: Variables = {}
    unpacked = 0
    for kind, data in _elements(contents[128:], order):
        if kind == _COMPRESSED:
            data = zlib.decompressobj().decompress(data, _UNPACKED_MAX + 1 - unpacked)
            unpacked += len(data)
            if unpacked > _UNPACKED_MAX:
                raise DataError(
                    f"{path}: more than {_UNPACKED_MAX / 1e6:.0f} MB unpacked; save fewer variables"
                )
            kind, data = next(_elements(data, order))
        if kind == _MATRIX:
            variables |= _matrix(data, order, "")
    return variables


def _elements(data: bytes, order: str) -> Iterator[tuple[int, bytes]]:
    """Type and contents of the elements one after the other; short ones keep both in eight bytes."""
    view, place = memoryview(data), 0
    while place + 8 <= len(view):
        kind, size = struct.unpack_from(order + "II", view, place)
        if kind >> 16:
            kind, size, start = kind & 0xFFFF, kind >> 16, place + 4
            place += 8
        else:
            start = place + 8
            place = start + size + (0 if kind == _COMPRESSED else -size % 8)
        if start + size > len(view):
            raise ValueError("an element reaches beyond the file")
        yield kind, bytes(view[start : start + size])
    if place < len(view):
        raise ValueError("bytes after the last element")


def _matrix(data: bytes, order: str, prefix: str) -> Variables:
    """The variable, or the fields of a structure of one element as `structure.field`."""
    parts = _elements(data, order)
    flags, shape, name = (
        _numbers(*part, order) for part in (next(parts), next(parts), next(parts))
    )
    label = prefix + bytes(name.astype(np.uint8)).decode("latin-1")
    kind = int(flags[0]) & 0xFF
    if kind == _STRUCTURE and not prefix and shape.prod() == 1:
        width = int(_numbers(*next(parts), order)[0])
        names = next(parts)[1]
        fields = [
            names[i : i + width].split(b"\0")[0].decode("latin-1")
            for i in range(0, len(names), width)
        ]
        found: Variables = {}
        for field, (_, inner) in zip(fields, parts, strict=False):
            values = _matrix(inner, order, f"{label}.") if inner else {"": None}
            found[f"{label}.{field}"] = next(iter(values.values()))
        return found
    if kind not in _NUMERIC or int(flags[0]) & _COMPLEX or len(shape) != 2:
        return {label: None}
    values = _numbers(*next(parts), order)
    return {label: values.reshape(tuple(map(int, shape)), order="F")}


def _numbers(kind: int, data: bytes, order: str) -> NDArray:
    return np.frombuffer(data, np.dtype(order + _TYPES[kind]))


def _level_4(contents: bytes) -> Variables:
    variables: Variables = {}
    place = 0
    while place < len(contents):
        order = "<" if 0 <= struct.unpack_from("<i", contents, place)[0] < 1000 else ">"
        kind, rows, columns, imaginary, length = struct.unpack_from(order + "5i", contents, place)
        thousands, kind = divmod(kind, 1000)
        zero, kind = divmod(kind, 100)
        precision, kind = divmod(kind, 10)
        if thousands not in (0, 1) or zero or min(rows, columns, length) < 0 or kind > 2:
            raise ValueError("not a header of level 4")
        number = np.dtype(order + _PRECISIONS[precision])
        start = place + 20 + length
        size = rows * columns * number.itemsize
        name = contents[place + 20 : start].split(b"\0")[0].decode("latin-1")
        real = kind == 0 and not imaginary
        values = np.frombuffer(contents[start : start + size], number)
        variables[name] = values.reshape((rows, columns), order="F") if real else None
        place = start + size * (2 if imaginary else 1)
    return variables


def columns_table(path: Path, variables: Variables) -> Table:
    """The vectors of equal length, one column each, with the columns of matrices."""
    variables, arranging = arranged(path, variables)
    numeric = {n: v for n, v in variables.items() if v is not None and v.size > 1}
    if not numeric:
        raise DataError(
            f"{path}: no vectors of numbers among its variables; save time and speed as vectors"
        )
    arrays = {n: v.reshape(-1, 1) if min(v.shape) == 1 else v for n, v in numeric.items()}
    rows = max(len(v) for v in arrays.values())
    if rows > ROWS_MAX:
        raise DataError(
            f"{path}: {rows} rows; allowed: up to {ROWS_MAX}; use a lower sampling rate"
        )
    wide = sum(v.shape[1] for v in arrays.values() if len(v) == rows)
    if wide > min(_COLUMNS_MAX, CELLS_MAX // rows):
        raise DataError(
            f"{path}: {wide} columns of {rows} rows; allowed: up to {_COLUMNS_MAX} columns and {CELLS_MAX} "
            "numbers; save fewer variables"
        )
    names, units, columns, others = [], [], [], []
    for name, array in variables.items():
        if name not in arrays or len(arrays[name]) != rows:
            others.append(f"{cleaned(name)} ({_shape(array)})")
            continue
        array = arrays[name]
        for i in range(array.shape[1]):
            names.append(cleaned(name) + (f"(:,{i + 1})" if array.shape[1] > 1 else ""))
            units.append(array_unit(name, array, i))
            columns.append(cells_of(array[:, i]))
    notes = ["MATLAB file, lines are row numbers", *arranging]
    left_out = f"left out, not of {rows} rows of numbers: {listed(others, ', ')}" * bool(others)
    lines = np.arange(1, rows + 1)
    return Table(names, units, columns, lines, notes, CONVENTION, left_out=left_out)


def cells_of(values: NDArray) -> Cells:
    """Numbers as a column's cells."""
    values = values.astype(float)
    values[np.isnan(values)] = (
        np.nan
    )  # one kind of several, some of which raise flags where they are used
    strange = np.flatnonzero(np.abs(values) > LARGEST)
    texts = [(int(row), repr(float(values[row]))) for row in strange[:LISTED]]
    values[strange] = np.nan
    number_count = int(np.isfinite(values).sum())
    return Cells([values], strange=texts, strange_count=len(strange), number_count=number_count)


def _shape(value: NDArray | None) -> str:
    return "no real numbers" if value is None else " x ".join(map(str, value.shape))
