"""A text file of columns to rows of cells: encoding, comment lines and the separator."""

import codecs
import csv
import re
from collections import Counter
from collections.abc import Iterator
from itertools import chain, islice
from pathlib import Path

from hevopt.errors import DataError
from hevopt.measured.tables.header import split_otherwise
from hevopt.measured.tables.names import unit_in_cell
from hevopt.measured.tables.rows import ROWS_MAX, Row, Table, numeric_share, runs, table_of
from hevopt.measured.tables.signals import is_signals_header, signals_table
from hevopt.measured.tables.vbo import vbo_table

_LINES_MAX = ROWS_MAX + 100_000
_LINE_MAX = 1_000_000
_HEAD_LINES = 500
_HEADERS_MAX = 2
_HEAD_LINE_MAX = 50_000
_COMMENTS = ("#", "%", "//", "*")
_SEPARATORS = {"\t": "tabs", ";": "semicolons", ",": "commas", "|": "bars", " ": "blanks"}
# Cells of which some are in quotes and go on in the next line, as wrapped headers of Excel do.
_QUOTED_LINE = re.compile(r"{0}(?:[,;\t|]{0})*".format(r'(?:\s*"(?:[^"]|"")*"\s*|[^",;\t|\n]*)'))
_CELL_LINES_MAX = 10
_BYTE_ORDER_MARKS = {
    codecs.BOM_UTF8: ("utf-8-sig", "UTF-8"),
    codecs.BOM_UTF16_LE: ("utf-16", "UTF-16"),
    codecs.BOM_UTF16_BE: ("utf-16", "UTF-16"),
}


Lines = list[tuple[int, str]]  # line number and text


def text_table(path: Path, contents: bytes) -> Table:
    """The table in the bytes of a text file."""
    text, encoding = _decoded(path, contents)
    lines = _lines(path, text)
    if table := vbo_table(path, lines):
        return table
    kept, comments, blank = _without_comments(_joined(lines))
    separator = _separator([line for _, line in kept[:_HEAD_LINES] if len(line) < _HEAD_LINE_MAX])
    if separator != "\t":
        blank = sorted(blank + [number for number, line in kept if line.isspace()])
        kept = [(number, line) for number, line in kept if not line.isspace()]
    kept = _with_commented_header(kept, comments, separator)
    rows = _rows(path, kept, separator)
    first = list(islice(rows, 1))
    if first and is_signals_header(first[0][1]):
        table = signals_table(path, first[0], rows)
    else:
        table = table_of(path, chain(first, rows), padded=False)
    notes = [f"{encoding}, separated by {_SEPARATORS[separator]}"]
    if comments:
        notes.append(f"comments: {runs([number for number, _ in comments])}")
    blank = [number for number in blank if number < kept[-1][0]]
    if blank:
        notes.append(f"blank: {runs(blank)}")
    table.notes[:0] = notes
    return table


def _decoded(path: Path, contents: bytes) -> tuple[str, str]:
    if contents.startswith((codecs.BOM_UTF32_LE, codecs.BOM_UTF32_BE)):
        raise DataError(f"{path}: UTF-32 text; save the file as UTF-8")
    marked = next((v for mark, v in _BYTE_ORDER_MARKS.items() if contents.startswith(mark)), None)
    if marked is None and b"\0" in contents:
        raise DataError(
            f"{path}: byte {contents.index(0)} is zero: not a text file, or UTF-16 without a byte order mark; "
            "give a text, .xlsx or .mat file, or save it as UTF-8"
        )
    for codec, name in [marked] if marked else [("utf-8", "UTF-8"), ("cp1252", "Windows-1252")]:
        try:
            return contents.decode(codec), name
        except UnicodeDecodeError as error:
            start = error.start
    allowed = f"valid {marked[1]}" if marked else "UTF-8 or Windows-1252"
    raise DataError(f"{path}: byte {start} is not {allowed} text; save the file as UTF-8")


def _lines(path: Path, text: str) -> list[str]:
    count = text.count("\n") + text.count("\r")
    if count > 2 * _LINES_MAX:
        raise DataError(f"{path}: over {ROWS_MAX} lines allowed; shorten the file")
    if "\r" in text:
        text = text.replace("\r\n", "\n").replace("\r", "\n")
    lines = text.split("\n")
    if len(lines) > _LINES_MAX:
        raise DataError(
            f"{path}: {len(lines)} lines; allowed: up to {ROWS_MAX}; shorten the file or use a lower "
            "sampling rate"
        )
    longest = max(range(len(lines)), key=lambda i: len(lines[i]))
    if len(lines[longest]) > _LINE_MAX:
        raise DataError(
            f"{path}, line {longest + 1}: {len(lines[longest])} characters; allowed: up to {_LINE_MAX} in a "
            "line; give a file with one row of numbers a line"
        )
    return lines


def _joined(lines: list[str]) -> Lines:
    """The lines with their numbers; those of a quoted cell with line breaks are one, numbered by its first."""
    joined: Lines = []
    numbered = iter(enumerate(lines, start=1))
    for number, line in numbered:
        more = _quoted_lines(lines, number) if '"' in line else 0
        parts = [line, *(next(numbered)[1] for _ in range(more))]
        joined.append((number, " ".join(parts)))
    return joined


def _quoted_lines(lines: list[str], number: int) -> int:
    """How many lines after this one belong to a cell whose quote it opens; 0 where no line soon closes it."""
    line = lines[number - 1]
    if line.count('"') % 2 == 0 or line.lstrip().startswith(_COMMENTS):
        return 0
    for more, later in enumerate(lines[number : number + _CELL_LINES_MAX], start=1):
        if later.count('"') % 2:
            whole = "\n".join(lines[number - 1 : number + more])
            return more if _QUOTED_LINE.fullmatch(whole) else 0
    return 0


def _without_comments(lines: Lines) -> tuple[Lines, Lines, list[int]]:
    """Lines with cells, which blanks between tabs are too, comment lines, and the numbers of blank lines."""
    kept, comments, blank = [], [], []
    for number, line in lines:
        start = line.lstrip()
        if not start and "\t" not in line:
            blank.append(number)
            continue
        # A units row may begin with the unit %.
        if start.startswith(_COMMENTS) and not (start[0] == "%" and _is_units_row(start)):
            comments.append((number, start))
        else:
            kept.append((number, line))
    return kept, comments, blank


def _is_units_row(line: str) -> bool:
    return any(
        len(cells) > 1 and cells[0].strip() == "%" and None not in map(unit_in_cell, cells)
        for cells in (line.split(separator) for separator in "\t;,")
    )


def _separator(lines: list[str]) -> str:
    """The separator under which most rows are numbers in rows of one length."""
    best, best_score = ",", 0.0
    for separator in _SEPARATORS:
        scores: Counter[int] = Counter()
        for line in lines:
            cells = _split(line, separator)
            if len(cells) > 1:
                scores[len(cells)] += numeric_share(cells)
        score = max(scores.values(), default=0.0)
        if score > best_score:
            best, best_score = separator, score
    return best


def _split(line: str, separator: str) -> list[str]:
    if separator == " ":
        return line.split()
    try:
        return [cell.strip() for cell in next(csv.reader([line], delimiter=separator), [])]
    except csv.Error:
        return []


def _with_commented_header(kept: Lines, comments: Lines, separator: str) -> Lines:
    """The last comment above the numbers joins the rows where it is their header, as some tools write it."""
    if not kept or not comments or not numeric_share(_split(kept[0][1], separator)) > 0.5:
        return kept
    above = [(number, text) for number, text in comments if number < kept[0][0]]
    if above:
        number, text = above[-1]
        text = text.lstrip("#%/*").strip()
        if len(_split(text, separator)) == len(_split(kept[0][1], separator)):
            comments.remove(above[-1])
            return [(number, text), *kept]
    return kept


def _headers(lines: Lines, separator: str) -> dict[int, list[str]]:
    """Line number and cells of the rows right above the data that are split otherwise than it."""
    head = [(number, line, _split(line, separator)) for number, line in lines[:_HEAD_LINES]]
    found: dict[int, list[str]] = {}
    start = next((i for i, (*_, c) in enumerate(head) if len(c) > 1 and numeric_share(c) >= 0.5), 0)
    above = [row for row in head[:start] if any(row[2])]
    for number, line, cells in above[-_HEADERS_MAX:]:
        if names := split_otherwise(
            line, _words(line) if separator == " " else cells, separator, len(head[start][2])
        ):
            found[number] = names
    return found


def _rows(path: Path, lines: Lines, separator: str) -> Iterator[Row]:
    headers = _headers(lines, separator)
    for number, cells in _split_rows(path, lines, separator):
        yield number, headers.get(number, cells)


def _split_rows(path: Path, lines: Lines, separator: str) -> Iterator[Row]:
    if separator == " ":
        for number, line in lines:
            yield number, _words(line)
        return
    reader = csv.reader((line for _, line in lines), delimiter=separator, skipinitialspace=True)
    before = 0
    try:
        for cells in reader:
            if reader.line_num > before + 1:
                raise csv.Error("a quote is opened and not closed in the line; remove it")
            yield lines[before][0], [cell.strip() for cell in cells]
            before += 1
    except csv.Error as error:
        fault = str(error).replace(
            "field larger than field limit", "a cell is longer than allowed, characters"
        )
        raise DataError(f"{path}, line {lines[before][0]}: {fault}") from None


def _words(line: str) -> list[str]:
    """Cells of a line with blanks between them; a unit in brackets belongs to the name before it."""
    cells: list[str] = []
    for word in line.split():
        if cells and word[0] in "[({" and word[-1] in "])}" and not _is_units_only(line):
            cells[-1] += f" {word}"
        else:
            cells.append(word.strip('"'))
    return cells


def _is_units_only(line: str) -> bool:
    return all(word[0] in "[({" for word in line.split())
