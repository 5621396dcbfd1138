"""CSV files with a header line, plain or compressed with gzip, as columns of numbers."""

import gzip
import warnings
import zlib
from collections.abc import Collection
from pathlib import Path
from typing import TextIO, cast

import numpy as np

from lapwing.dynamics.input_file import unreadable
from lapwing.studies.flight_import.message_columns import NumberRows

RATIO, SMALLEST = 100, 16_000_000  # largest size of unpacked text: relative to the file, [bytes] for small files
BLOCK = 1 << 20  # [bytes] read at once


def read_columns(path: Path, selected: Collection[str]) -> dict[str, np.ndarray]:
    """Return those of the selected columns that a CSV file has, by name; empty fields are NaN.

    Raises:
        ValueError: the file cannot be read, has no header or no rows, or a field is not a number.
    """
    try:
        _check_unpacked_size(path)
        with warnings.catch_warnings(), _open(path) as file:
            names = [name.strip().strip('"') for name in file.readline().split(",")]
            result = [name for name in dict.fromkeys(selected) if name in names]
            if not result:
                raise ValueError(f"{path}: none of the mapped columns in the header; check the --mapping")
            indices = [names.index(name) for name in result]
            try:
                warnings.simplefilter("ignore", UserWarning)  # a file without rows is an error below
                table = np.loadtxt(file, delimiter=",", usecols=indices, ndmin=2)
            except ValueError:
                table = None
        if table is None:  # empty fields need the slower, tolerant parser
            table = _read_tolerant(path, indices)
    except OSError as error:
        raise unreadable(path, error, "a table (.csv, .csv.gz)") from None
    except (UnicodeDecodeError, EOFError, zlib.error):
        raise ValueError(f"{path}: is not a text file of columns; expected CSV, or CSV compressed with gzip") from None
    if not len(table):
        raise ValueError(f"{path}: has no rows; expected a recorded flight")
    return dict(zip(result, table.T, strict=True))


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
    if path.suffix == ".gz":
        return cast(TextIO, gzip.open(path, "rt", encoding="utf-8"))
    return path.open(encoding="utf-8")


def _read_tolerant(path: Path, indices: list[int]) -> np.ndarray:
    def number(line: int, text: str) -> float:
        text = text.strip().strip('"')
        try:
            return float(text) if text else np.nan
        except ValueError:
            raise ValueError(f"{path}:{line}: {text[:20]!r} is not a number; expected numbers in every row") from None

    rows = NumberRows()
    with _open(path) as file:
        next(file)
        for line, row in enumerate(file, start=2):
            fields = row.rstrip("\n").split(",")
            if len(fields) <= max(indices):
                if row.strip():
                    raise ValueError(f"{path}:{line}: row is cut short; delete it, or record the flight again")
                continue
            rows.append([number(line, fields[k]) for k in indices])
    return rows.to_array()
