"""CSV files with a header line, plain or compressed with gzip, as columns of numbers."""

import gzip
import warnings
import zlib
from collections.abc import Collection
from pathlib import Path
from typing import TextIO, cast

import numpy as np


def read_columns(path: Path, selected: Collection[str]) -> dict[str, np.ndarray]:
    """Return the wanted columns of a CSV file that has them, by name; empty fields are NaN.

    Raises:
        ValueError: the file cannot be read, has no header or no rows, or a field is not a number.
    """
    try:
        with warnings.catch_warnings(), _open(path) as file:
            names = [name.strip().strip('"') for name in file.readline().split(",")]
            result = [name for name in dict.fromkeys(selected) if name in names]
            if not result:
                raise ValueError(f"{path}: no known column in its header; check the --mapping")
            places = [names.index(name) for name in result]
            try:
                warnings.simplefilter("ignore", UserWarning)  # of a file without rows, which is an error below
                table = np.loadtxt(file, delimiter=",", usecols=places, ndmin=2)
            except ValueError:
                table = None
        if table is None:  # empty fields: slower, but as tolerant as the format allows
            table = _tolerant(path, places)
    except OSError as error:
        raise ValueError(f"{path}: cannot be read: {(error.strerror or str(error)).lower()}") from None
    except (UnicodeDecodeError, EOFError, zlib.error):
        raise ValueError(f"{path}: is not a text file of columns; expected CSV, or CSV compressed with gzip") from None
    if not len(table):
        raise ValueError(f"{path}: has no rows; expected a recorded flight")
    return dict(zip(result, table.T, strict=True))


def _open(path: Path) -> TextIO:
    if path.suffix == ".gz":
        return cast(TextIO, gzip.open(path, "rt", encoding="utf-8"))
    return path.open(encoding="utf-8")


def _tolerant(path: Path, places: list[int]) -> np.ndarray:
    def number(line: int, text: str) -> float:
        text = text.strip().strip('"')
        try:
            return float(text) if text else np.nan
        except ValueError:
            raise ValueError(f"{path}:{line}: {text[:20]!r} is not a number; expected numbers in every row") from None

    rows = []
    with _open(path) as file:
        next(file)
        for line, row in enumerate(file, start=2):
            fields = row.rstrip("\n").split(",")
            if len(fields) <= max(places):
                if row.strip():
                    raise ValueError(f"{path}:{line}: row is cut short; delete it, or record the flight again")
                continue
            rows.append([number(line, fields[k]) for k in places])
    return np.array(rows).reshape(len(rows), len(places))
