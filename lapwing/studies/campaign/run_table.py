"""Table of a campaign on disk with a row for each run, as CSV or, with pyarrow, as Parquet."""

import csv
import json
import math
from collections.abc import Iterable, Iterator, Mapping
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

Row = Mapping[str, Any]


def has_parquet() -> bool:
    """Return True if pyarrow is installed."""
    return find_spec("pyarrow") is not None


def write_csv(path: Path, kinds: Mapping[str, type], pages: Iterable[Iterable[Row]]) -> None:
    """Write rows as CSV: numbers exactly, as their repr; NaN as an empty cell.

    Args:
        path: path of the file.
        kinds: type of each column: int, float, bool or str.
        pages: rows in groups.
    """
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(kinds)
        for page in pages:
            writer.writerows([_text(row.get(name), kind) for name, kind in kinds.items()] for row in page)


def read_csv(path: Path, kinds: Mapping[str, type]) -> list[dict[str, Any]]:
    """Return the rows of a file of `write_csv`.

    Raises:
        ValueError: the file is not such a table, or has other columns.
    """
    try:
        with path.open(encoding="utf-8", newline="") as file:
            head, *lines = csv.reader(file)
        if head != list(kinds):
            raise ValueError("has other columns")
        return [
            {name: _value(cell, kind) for (name, kind), cell in zip(kinds.items(), line, strict=True)} for line in lines
        ]
    except (OSError, ValueError, csv.Error) as fault:
        message = f"not a table of this campaign: {fault}; delete the file to repeat its runs"
        raise ValueError(f"{path}: {message}") from None


def write_parquet(
    path: Path, kinds: Mapping[str, type], pages: Iterable[Iterable[Row]], metadata: Mapping[str, str]
) -> None:
    """Write rows as Parquet with a row group for each page and metadata in the schema; requires pyarrow."""
    import pyarrow
    from pyarrow import parquet

    types = {int: pyarrow.int64(), float: pyarrow.float64(), bool: pyarrow.bool_(), str: pyarrow.string()}
    schema = pyarrow.schema([(name, types[kind]) for name, kind in kinds.items()], metadata=dict(metadata))
    with parquet.ParquetWriter(path, schema) as writer:
        for page in pages:
            rows = [{name: _plain(row.get(name), kind) for name, kind in kinds.items()} for row in page]
            writer.write_table(pyarrow.Table.from_pylist(rows, schema=schema))


def arrays(kinds: Mapping[str, type], pages: Iterable[Iterable[Row]]) -> dict[str, np.ndarray]:
    """Return the columns of a table, shape (n,) each; texts as objects."""
    lists: dict[str, list[np.ndarray]] = {name: [] for name in kinds}
    for page in pages:
        rows = list(page)
        for name, kind in kinds.items():
            values = [_plain(row.get(name), kind) for row in rows]
            lists[name].append(np.array(values, object if kind is str else kind))
    return {name: np.concatenate(parts) if parts else np.empty(0) for name, parts in lists.items()}


def _plain(value: Any, kind: type) -> Any:
    """Convert a value to its column's type; other values in text columns become JSON."""
    if kind is str:
        return value if isinstance(value, str) else "" if value is None else json.dumps(value)
    return math.nan if value is None else kind(value)


def _text(value: Any, kind: type) -> str:
    result = _plain(value, kind)
    if isinstance(result, bool):
        return "true" if result else "false"
    return "" if isinstance(result, float) and math.isnan(result) else str(result)


def _value(cell: str, kind: type) -> Any:
    if kind is bool:
        return cell == "true"
    return math.nan if kind is float and not cell else kind(cell)


def digest_lines(kinds: Mapping[str, type], rows: Iterable[Row]) -> Iterator[bytes]:
    """Yield the rows as bytes for a digest."""
    for row in rows:
        yield "\x1f".join(_text(row.get(name), kind) for name, kind in kinds.items()).encode() + b"\n"
