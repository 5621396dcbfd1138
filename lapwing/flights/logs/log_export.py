"""Export of a log as tables: one for each topic, with a column for each number or text, and units."""

import csv
import re
from collections.abc import Collection
from pathlib import Path
from typing import Any

import numpy as np

from lapwing.cosim.log import LogReader
from lapwing.flights.topic_view import TopicView
from lapwing.messages import TYPES
from lapwing.messages.types import unit

Table = dict[str, tuple[str, np.ndarray]]  # unit and values (n,) by the name of the column


def tables(log: LogReader, topics: Collection[str] | None = None) -> dict[str, Table]:
    """Return the topics of a log, by default all, as tables by name; the first column is the time [s].

    Raises:
        ValueError: a topic is missing or of an unknown type.
    """
    types = log.topics()
    result = {}
    for topic, (times_ns, columns) in log.histories(topics).items():
        view, kind = TopicView(times_ns, columns), TYPES[types[topic]].type_name
        flat = {name: (unit(kind, name), values) for name, values in view.flat().items()}
        result[topic] = {"time": ("s", view.times)} | flat
    return result


def write_csv(tables: dict[str, Table], folder: Path) -> list[Path]:
    """Write a file per topic; the first line has names and units: "velocity.x [m/s]"."""
    paths = []
    for topic, table in tables.items():
        path = folder / f"{_file_name(topic)}.csv"
        with path.open("w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file)
            writer.writerow([f"{name} [{unit}]" if unit else name for name, (unit, _) in table.items()])
            writer.writerows(zip(*(_plain(values) for _, values in table.values()), strict=True))
        paths.append(path)
    return paths


def write_parquet(tables: dict[str, Table], folder: Path) -> list[Path]:
    """Write a file per topic; the metadata of each field has its unit, key "unit".

    Raises:
        ValueError: pyarrow is not installed.
    """
    try:
        import pyarrow
        import pyarrow.parquet
    except ImportError:
        raise ValueError("--parquet: pyarrow is not installed; pip install lapwing[parquet]") from None
    paths = []
    for topic, table in tables.items():
        arrays = {name: pyarrow.array(_plain(values)) for name, (_, values) in table.items()}
        units = {name: {"unit": unit} if unit else None for name, (unit, _) in table.items()}
        fields = [pyarrow.field(name, array.type, metadata=units[name]) for name, array in arrays.items()]
        path = folder / f"{_file_name(topic)}.parquet"
        pyarrow.parquet.write_table(pyarrow.table(list(arrays.values()), pyarrow.schema(fields)), path)
        paths.append(path)
    return paths


def write_mat(tables: dict[str, Table], path: Path) -> list[Path]:
    """Write one MATLAB file: a struct of columns per topic, whose field `units` is a struct with the same names."""
    from scipy.io import savemat

    structs: dict[str, Any] = {}
    for topic, table in tables.items():
        columns = {_identifier(name): _matlab(values) for name, (_, values) in table.items()}
        structs[_identifier(topic)] = columns | {
            "units": {_identifier(name): unit for name, (unit, _) in table.items()}
        }
    savemat(path, structs, long_field_names=True, oned_as="column")
    return [path]


def _plain(values: np.ndarray) -> list[Any]:
    """Convert to numbers and texts of Python; several values become one text."""
    if values.dtype != object:
        return values.tolist()
    return [value if isinstance(value, str) else "; ".join(map(str, value)) for value in values]


def _matlab(values: np.ndarray) -> np.ndarray:
    return np.array(_plain(values), object) if values.dtype.kind in "OU" else values


def _file_name(topic: str) -> str:
    return topic.strip("/").replace("/", ".")


def _identifier(name: str) -> str:
    """Return a valid MATLAB identifier: letters, digits and underscores, a letter first."""
    result = re.sub(r"\W", "_", name.strip("/"))
    return result if result[:1].isalpha() else f"x{result}"
