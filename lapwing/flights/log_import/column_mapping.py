"""Mapping files: columns, units and frames of the quantities in a table."""

import tomllib
from collections.abc import Collection
from importlib.resources import files
from pathlib import Path
from typing import Any, Literal

import numpy as np
from pydantic import ConfigDict, ValidationError

from lapwing.dynamics.constants import STANDARD_GRAVITY
from lapwing.dynamics.input_file import read_text, unreadable
from lapwing.dynamics.validation import Table, fault

SCALES = {
    "s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9,
    "m": 1.0, "cm": 1e-2, "mm": 1e-3,
    "m/s": 1.0, "cm/s": 1e-2, "mm/s": 1e-3,
    "rad": 1.0, "deg": np.pi / 180.0,
    "rad/s": 1.0, "deg/s": np.pi / 180.0, "mrad/s": 1e-3,
    "m/s^2": 1.0, "g": STANDARD_GRAVITY, "mg": 1e-3 * STANDARD_GRAVITY,
    "V": 1.0, "mV": 1e-3, "cV": 1e-2,
}  # fmt: skip


class _Table(Table):
    model_config = ConfigDict(strict=False)  # tuples are lists in TOML


class Scalar(_Table):
    """Column of a scalar."""

    column: str
    unit: str
    range: tuple[float, float] | None = None  # [SI] valid range; readings outside are faults
    smoothing: float = 0.0  # [s] window of a running median


class Vector(_Table):
    """Columns of a vector (three) or a quaternion (four)."""

    columns: tuple[str, ...]
    unit: str
    scale: float = 1.0  # units per count of the columns
    frame: Literal["enu", "ned", "flu", "frd", "enu_flu", "ned_frd"]
    sign: tuple[int, ...] = ()  # signs of the columns in the frame; all positive if omitted


class Motors(_Table):
    """Columns of the motors, in the order of the airframe."""

    columns: tuple[str, ...]
    unit: Literal["duty", "V"]
    full_scale: float = 1.0  # value of the columns at full duty, or at 1 V
    offset: float = 0.0  # value of the columns at zero duty
    unused_below: float = 0.0  # duty that some motor falls below, unless the columns are in other units


class Mapping(_Table):
    """Mapping of all quantities of an import.

    With `partial`, quantities other than time, omega and motors are omitted if the file lacks their columns. Setpoints
    are always optional.
    """

    partial: bool = False
    time: Scalar
    position: Vector | None = None
    attitude: Vector | None = None
    velocity: Vector | None = None
    omega: Vector
    specific_force: Vector | None = None
    motors: Motors
    battery: Scalar | None = None
    power: Scalar | None = None
    setpoint: Vector | None = None

    @property
    def columns(self) -> list[str]:
        """Names of all columns."""
        return [column for columns in self._columns().values() for column in columns]

    def within(self, names: Collection[str]) -> "Mapping":
        """Return the mapping without optional quantities whose columns are not among `names`."""
        missing = [key for key, columns in self._columns().items() if not set(columns) <= set(names)]
        optional = set(missing) - {"time", "omega", "motors"} if self.partial else set(missing) & {"setpoint"}
        return self.model_copy(update=dict.fromkeys(optional))

    def _columns(self) -> dict[str, tuple[str, ...]]:
        tables = {name: getattr(self, name) for name in type(self).model_fields}
        return {
            name: (table.column,) if isinstance(table, Scalar) else table.columns
            for name, table in tables.items()
            if isinstance(table, Scalar | Vector | Motors)
        }


def load_mapping(name: str) -> Mapping:
    """Read a mapping by the name of an included one, or by the path of a TOML file.

    Raises:
        ValueError: the mapping does not exist or is invalid.
    """
    shipped = sorted(f.name.removesuffix(".toml") for f in files(__package__).joinpath("mappings").iterdir())
    if name in shipped:
        text = files(__package__).joinpath("mappings", f"{name}.toml").read_text(encoding="utf-8")
    else:
        path = Path(name)
        if path.suffix != ".toml":
            raise ValueError(f"--mapping {name}: unknown; use one of {', '.join(shipped)}, or a .toml file")
        try:
            text = read_text(path)
        except (OSError, UnicodeDecodeError) as error:
            raise unreadable(f"--mapping {name}", error, "a mapping file (.toml)") from None
    try:
        mapping = Mapping.model_validate(tomllib.loads(text))
    except tomllib.TOMLDecodeError as error:
        raise ValueError(f"--mapping {name}: not valid TOML: {error}") from None
    except ValidationError as error:
        raise ValueError(f"--mapping {name}: {fault(error, Mapping)}") from None
    _check(name, mapping)
    return mapping


def _check(name: str, mapping: Mapping) -> None:
    for key in type(mapping).model_fields:
        table: Any = getattr(mapping, key)
        if not isinstance(table, Scalar | Vector):
            continue
        counts = (3, 4) if key == "attitude" else (3,)
        if isinstance(table, Vector) and len(table.columns) not in counts:
            raise ValueError(f"--mapping {name}: {key}.columns has {len(table.columns)} names; expected {counts[-1]}")
        other = {"attitude": ("wxyz", "xyzw"), "power": ("W",)}.get(key, ())
        if table.unit not in SCALES and table.unit not in other:
            units = ", ".join((*SCALES, *other))
            raise ValueError(f"--mapping {name}: {key}.unit {table.unit!r} is unknown; use one of {units}")
