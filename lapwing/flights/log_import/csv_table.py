"""CSV files with a header line, plain or compressed with gzip, as columns of numbers."""

import codecs
import contextlib
import csv
import gzip
import itertools
import warnings
import zlib
from collections.abc import Collection
from pathlib import Path
from typing import NamedTuple, TextIO, cast

import numpy as np

from lapwing.dynamics.input_file import unreadable
from lapwing.flights.log_import.message_columns import NumberRows

RATIO, SMALLEST = 100, 16_000_000  # largest size of unpacked text: relative to the file, [bytes] for small files
BLOCK = 1 << 20  # [bytes] read at once
HEAD = 200  # lines among which the header is
SEPARATORS = (",", ";", "\t")


def read_columns(path: Path, selected: Collection[str]) -> dict[str, np.ndarray]:
    """Return those of the selected columns that a CSV file has, by name; empty fields are NaN.

    The text is UTF-8 or UTF-16 with a byte order mark. Fields are separated by commas, semicolons or tabs, may be
    quoted, and have decimal commas if no comma separates them. Rows that begin with # are comments; the header may
    begin with one.

    Raises:
        ValueError: the file cannot be read, has no header or no rows, or a field is not a number.
    """
    try:
        _check_unpacked_size(path)
        dialect = _dialect(path, selected)
        names = [dialect.names.index(name) for name in dict.fromkeys(selected) if name in dialect.names]
        result = [dialect.names[k] for k in names]
        table = None
        if dialect.is_plain:
            with warnings.catch_warnings(), _open(path) as file, contextlib.suppress(ValueError):
                for _ in range(dialect.line):
                    next(file)
                warnings.simplefilter("ignore", UserWarning)  # a file without rows is an error below
                table = np.loadtxt(file, delimiter=dialect.separator, usecols=names, ndmin=2)
        if table is None:  # empty and quoted fields need the slower, tolerant parser
            table = _read_tolerant(path, dialect, names)
    except OSError as error:
        raise unreadable(path, error, "a table (.csv, .csv.gz)") from None
    except (UnicodeError, EOFError, zlib.error, csv.Error):
        raise ValueError(f"{path}: is not a text file of columns; expected CSV, or CSV compressed with gzip") from None
    if not len(table):
        raise ValueError(f"{path}: has no rows; expected a recorded flight")
    return dict(zip(result, table.T, strict=True))


class _Dialect(NamedTuple):
    """Form of a file.

    Attributes:
        separator: separator of the fields.
        line: number of the header's line, from 1.
        names: names of the columns.
        is_plain: True if numbers have decimal points and the first row no quotes.
    """

    separator: str
    line: int
    names: list[str]
    is_plain: bool


def _dialect(path: Path, selected: Collection[str]) -> _Dialect:
    """Return the form of a file, whose header is the first line with a selected name."""
    best: list[str] = []
    with _open(path) as file:
        lines = [line.rstrip("\n") for line in itertools.islice(file, HEAD)]
    for number, line in enumerate(lines, start=1):
        for separator in SEPARATORS:
            names = [name.strip().strip('"') for name in next(csv.reader([line.lstrip("# ")], delimiter=separator), [])]
            if set(names) & set(selected):
                rows = [row for row in lines[number:] if row.strip() and not row.startswith("#")]
                plain = bool(rows) and not any(mark in rows[0] for mark in ('"', "," if separator != "," else '"'))
                if twice := [name for name in selected if names.count(name) > 1]:
                    raise ValueError(f"{path}:{number}: column {twice[0]} occurs twice; rename or delete one")
                if separator == "," and rows and (fields := len(next(csv.reader(rows[:1])))) == 2 * len(names) > 2:
                    raise ValueError(
                        f"{path}:{number + 1}: has {fields} fields for {len(names)} columns, decimal commas are "
                        "suspected; separate the fields by semicolons, or write decimal points"
                    )
                return _Dialect(separator, number, names, plain)
            if not line.startswith("#") and len(names) > len(best):
                best = names
    header = f"its first columns are {', '.join(best[:3])}" if best else "it has no header"
    raise ValueError(f"{path}: none of the mapped columns in the header; {header}; check the --mapping")


def _check_unpacked_size(path: Path) -> None:
    """Raise ValueError if a compressed file unpacks to far more text than a flight, before it is kept in memory."""
    if path.suffix != ".gz":
        return
    most, size = max(RATIO * path.stat().st_size, SMALLEST), 0
    with gzip.open(path) as file:
        while block := file.read(BLOCK):
            size += len(block)
            if size > most:
                message = f"unpacks to over {most / 1e6:.0f} MB; expected at most {RATIO} times the size of the file"
                raise ValueError(f"{path}: {message}")


def _open(path: Path) -> TextIO:
    with gzip.open(path) if path.suffix == ".gz" else path.open("rb") as file:
        mark = file.read(4)
    errors = "strict" if b"\0" in mark else "replace"  # names of columns may be in another encoding
    encoding = "utf-16" if mark[:2] in (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE) else "utf-8-sig"
    if path.suffix == ".gz":
        return cast(TextIO, gzip.open(path, "rt", encoding=encoding, errors=errors))
    return path.open(encoding=encoding, errors=errors)


def _read_tolerant(path: Path, dialect: _Dialect, indices: list[int]) -> np.ndarray:
    def number(line: int, column: str, text: str) -> float:
        text = text.strip().strip('"')
        if text.count(",") == 1:  # a comma within a field is decimal: it does not separate fields
            text = text.replace(",", ".")
        try:
            return float(text) if text else np.nan
        except ValueError:
            raise ValueError(
                f"{path}:{line}: {text[:20]!r} in column {column} is not a number; expected numbers in every row"
            ) from None

    rows = NumberRows()
    with _open(path) as file:
        for line, text in enumerate(file, start=1):
            if line <= dialect.line or not text.strip() or text.startswith("#"):
                continue
            fields = next(csv.reader([text], delimiter=dialect.separator, skipinitialspace=True))
            if [field.strip() for field in fields] == dialect.names:
                continue  # the header again
            if len(fields) <= max(indices):
                raise ValueError(f"{path}:{line}: row is cut short; delete it, or record the flight again")
            rows.append([number(line, dialect.names[k], fields[k]) for k in indices])
    return rows.to_array()
