"""Parameter files of QGroundControl (read and written) and MAVProxy (read).

Rows of QGroundControl are vehicle, component, name, value, type, separated by tabs; those of MAVProxy are name and
value. Lines that begin with # are comments. Source: QGroundControl developer guide, "Parameters file format".
"""

from collections.abc import Iterable, Mapping
from pathlib import Path

from lapwing.cosim.complete_file import write_text
from lapwing.cosim.scene import KeyOrigin, SceneError
from lapwing.dynamics.input_file import read_text
from lapwing.services.common.autopilot_parameters import Parameter

_INT32, _REAL32 = 6, 9  # MAV_PARAM_TYPE
_HEADER = ("# Onboard parameters for Vehicle 1", "#", "# Vehicle-Id Component-Id Name Value Type")


def read(path: Path) -> dict[str, float]:
    """Return the values of a file by name.

    Raises:
        ValueError: (one line) the file cannot be read or a line is invalid.
    """
    try:
        return parse(read_text(path), path)
    except OSError as error:
        raise ValueError(f"{path}: {(error.strerror or 'cannot be read').lower()}") from None
    except UnicodeDecodeError:
        raise ValueError(f"{path}: not a UTF-8 text file; expected one parameter per line") from None


def parse(text: str, path: Path) -> dict[str, float]:
    """Return the values in the text of a file. Raise SceneError with the line that is invalid."""
    values = {}
    for number, line in enumerate(text.splitlines(), start=1):
        row = line.split()
        if not row or row[0].startswith("#"):
            continue
        if len(row) not in (2, 5):
            message = f"got {line.strip()!r}"
            raise SceneError("", message, "name and value (or 5 columns)", KeyOrigin(path, number))
        name, value = row if len(row) == 2 else row[2:4]
        try:
            values[name] = float(value)
        except ValueError:
            raise SceneError(name, f"got {value!r}", "a number", KeyOrigin(path, number)) from None
    return values


def write(path: Path, table: Iterable[Parameter], values: Mapping[str, float]) -> None:
    """Write `values` of the parameters in `table`. Raise ValueError (one line) if the file cannot be written."""
    rows = []
    for p in sorted(table, key=lambda p: p.name):
        value, kind = (f"{values[p.name]:.0f}", _INT32) if p.integer else (repr(values[p.name]), _REAL32)
        rows.append(f"1\t1\t{p.name}\t{value}\t{kind}")
    write_text(path, "\n".join([*_HEADER, *rows, ""]))
