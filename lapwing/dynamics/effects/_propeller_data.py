"""Propeller test data: thrust and power coefficients over the advance ratio, from published text files.

The columns J, CT and CP (or CQ) have a header line and are separated by commas, semicolons or blanks, as on
J. Brandt and M. Selig's UIUC Propeller Data Site. A column `angle` [deg], of the air against the rotor's flow, makes a
grid.
"""

import math
import re
from collections.abc import Sequence
from typing import Any

from lapwing.dynamics.config_error import ConfigError

NEEDED = {"j": "J", "ct": "CT", "cp": "CP or CQ"}


def parse_table(key: str, text: str) -> dict[str, Any]:
    """Return the keys of `rotor_table` in a text.

    Args:
        key: key whose value names the file, for errors.
        text: text of the file.

    Raises:
        ConfigError: a column is missing, a row has a gap, or angles have different J.
    """
    lines = [(i, line.strip()) for i, line in enumerate(text.splitlines(), 1)]
    lines = [(i, line) for i, line in lines if line and not line.startswith(("#", "!"))]
    if not lines:
        raise ConfigError(key, "the file is empty", "columns J, CT, CP")
    names = [name.lower() for name in _cells(lines[0][1])]
    if "cq" in names:
        names = ["cp" if name == "cq" else name for name in names]
    for name, description in NEEDED.items():
        if names.count(name) != 1:
            raise ConfigError(
                key, f"line {lines[0][0]} names {names.count(name)} columns {description}", "one of each: J, CT, CP"
            )
    turn = 2.0 * math.pi if "cq" in lines[0][1].lower() else 1.0
    curves: dict[float, list[tuple[float, float, float]]] = {}
    for number, line in lines[1:]:
        row = dict(zip(names, _numbers(key, number, line, len(names)), strict=True))
        curves.setdefault(row.get("angle", 0.0), []).append((row["j"], row["ct"], turn * row["cp"]))
    if not curves:
        raise ConfigError(key, "has no row of numbers", "columns J, CT, CP")
    angles = sorted(curves)
    advance = [j for j, _, _ in curves[angles[0]]]
    for angle in angles:
        if [j for j, _, _ in curves[angle]] != advance:
            raise ConfigError(
                key, f"the J at {angle:g} deg differ from those at {angles[0]:g} deg", "the same at each angle"
            )
    return {
        "advance": advance,
        "angle_deg": angles,
        "thrust": [[ct for _, ct, _ in curves[angle]] for angle in angles],
        "power": [[cp for _, _, cp in curves[angle]] for angle in angles],
    }


def _cells(line: str) -> list[str]:
    return [cell.strip() for cell in re.split(r"[,;\t]", line)] if re.search(r"[,;\t]", line) else line.split()


def _numbers(key: str, number: int, line: str, count: int) -> Sequence[float]:
    cells = _cells(line)
    if len(cells) != count:
        raise ConfigError(key, f"line {number} has {len(cells)} columns", f"{count} as its first line")
    try:
        numbers = [float(cell) for cell in cells]
    except ValueError:
        numbers = [math.nan]
    if not all(map(math.isfinite, numbers)):
        raise ConfigError(key, f"line {number}: {line!r} has no number in a column", "a number in each column")
    return numbers
