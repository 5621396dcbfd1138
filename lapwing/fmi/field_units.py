"""Units of the fields of NamedTuples, read from the comments of their source, such as `speed: float  # [m/s]`."""

import ast
import inspect
import re
from collections.abc import Mapping
from functools import cache
from typing import NamedTuple

from lapwing.syntax_tree import parse

_UNIT = re.compile(r"^\s*(\w+)\s*:.*#\s*\[([^\]]+)\]")
_BASE = ("kg", "m", "s", "A", "K", "rad")  # base units of FMI that occur
_DERIVED: Mapping[str, tuple[float, Mapping[str, int]]] = {
    **{name: (1.0, {name: 1}) for name in _BASE},
    "Hz": (1.0, {"s": -1}),
    "N": (1.0, {"kg": 1, "m": 1, "s": -2}),
    "Pa": (1.0, {"kg": 1, "m": -1, "s": -2}),
    "J": (1.0, {"kg": 1, "m": 2, "s": -2}),
    "W": (1.0, {"kg": 1, "m": 2, "s": -3}),
    "V": (1.0, {"kg": 1, "m": 2, "s": -3, "A": -1}),
    "Ohm": (1.0, {"kg": 1, "m": 2, "s": -3, "A": -2}),
    "ohm": (1.0, {"kg": 1, "m": 2, "s": -3, "A": -2}),
    "H": (1.0, {"kg": 1, "m": 2, "s": -2, "A": -2}),
    "F": (1.0, {"kg": -1, "m": -2, "s": 4, "A": 2}),
    "C": (1.0, {"A": 1, "s": 1}),
    "T": (1.0, {"kg": 1, "s": -2, "A": -1}),
    "deg": (3.14159265358979323846 / 180.0, {"rad": 1}),
    "ft": (0.3048, {"m": 1}),
    "g": (1e-3, {"kg": 1}),
    "h": (3600.0, {"s": 1}),
    "min": (60.0, {"s": 1}),
    "ms": (1e-3, {"s": 1}),
    "mm": (1e-3, {"m": 1}),
    "cm": (1e-2, {"m": 1}),
    "km": (1e3, {"m": 1}),
    "kN": (1e3, {"kg": 1, "m": 1, "s": -2}),
    "kW": (1e3, {"kg": 1, "m": 2, "s": -3}),
    "mV": (1e-3, {"kg": 1, "m": 2, "s": -3, "A": -1}),
    "mA": (1e-3, {"A": 1}),
    "rpm": (2.0 * 3.14159265358979323846 / 60.0, {"rad": 1, "s": -1}),
    "1": (1.0, {}),
}


class Unit(NamedTuple):
    """A unit as a factor and powers of base units."""

    factor: float
    powers: tuple[tuple[str, int], ...]  # base unit and exponent, none of them 0


@cache
def _units_of_class(cls: type) -> dict[str, str]:
    try:
        lines = inspect.getsource(cls).splitlines()
    except (OSError, TypeError):
        return {}
    return {match[1]: match[2].strip() for line in lines if (match := _UNIT.match(line))}


def field_unit(owner: type | None, field: str) -> str:
    """Return the unit in the source comment of a NamedTuple's field, "" without a comment or for an unknown unit."""
    name = _units_of_class(owner).get(field, "") if owner else ""
    return name if name and parse_unit(name) is not None else ""


@cache
def parse_unit(name: str) -> Unit | None:
    """Return a unit from a text such as "(m/s)^2", "N m" or "kg m^2/s"; return None for other texts.

    A blank or a dot multiplies. Everything after a slash up to the next blank divides.
    """
    text = name.strip().replace("·", "*").replace("²", "^2").replace("³", "^3")
    text = re.sub(r"(?<=[\w)])\s+(?=[\w(])|(?<=[A-Za-z)])\.(?=[A-Za-z(])", "*", text).replace("^", "**")
    try:
        tree = parse(text, mode="eval")
        factor, powers = _evaluate(tree.body)
    except (SyntaxError, ValueError, KeyError):
        return None
    return Unit(factor, tuple((base, powers[base]) for base in sorted(powers) if powers[base]))


def _evaluate(node: ast.expr) -> tuple[float, dict[str, int]]:
    if isinstance(node, ast.Name):
        factor, powers = _DERIVED[node.id]
        return factor, dict(powers)
    if isinstance(node, ast.Constant) and node.value == 1:
        return 1.0, {}
    if isinstance(node, ast.BinOp):
        factor, powers = _evaluate(node.left)
        if isinstance(node.op, ast.Pow):
            exponent = ast.literal_eval(node.right)
            if not isinstance(exponent, int):
                raise ValueError("the exponent is not an integer")
            product = 1.0
            for _ in range(abs(exponent)):
                product *= factor
            product = product if exponent >= 0 else 1.0 / product
            return product, {base: n * exponent for base, n in powers.items()}
        sign = {ast.Mult: 1, ast.Div: -1}.get(type(node.op))
        if sign is not None:
            other, others = _evaluate(node.right)
            for base, n in others.items():
                powers[base] = powers.get(base, 0) + sign * n
            return (factor * other if sign > 0 else factor / other), powers
    raise ValueError("not a unit")
