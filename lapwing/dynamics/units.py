"""Numbers with units as people write them: "30 deg", 7in, 1300KV, "60 km/h"."""

import re

PI = 3.141592653589793  # the kernels' is slow to import, and commands read options with units before they check them
INCH, POUND_FORCE, FOOT, KNOT = 0.0254, 4.4482216, 0.3048, 1852.0 / 3600.0
ANGLE = {"rad": 1.0, "deg": PI / 180.0, "°": PI / 180.0}
LENGTH = {"m": 1.0, "km": 1e3, "cm": 0.01, "mm": 1e-3, "in": INCH, "inch": INCH, '"': INCH, "ft": FOOT}
SPEED = {"m/s": 1.0, "km/h": 1.0 / 3.6, "kn": KNOT, "mph": 0.44704}
ANGULAR_RATE = {"rad/s": 1.0, "deg/s": PI / 180.0, "rpm": PI / 30.0}
UNITS: dict[str, dict[str, float]] = {  # unit of a value: accepted units, in small letters, and their size
    "kg": {"kg": 1.0, "g": 1e-3, "lb": 0.45359237, "oz": 0.02834952},
    "m": LENGTH,
    "rad": ANGLE,
    "deg": {name: size * 180.0 / PI for name, size in ANGLE.items()},
    "m/s": SPEED,
    "rad/s": ANGULAR_RATE,
    "u": {"m": 1.0, **ANGLE},  # of a channel of a trajectory: m or rad
    "u/s": {**SPEED, **ANGULAR_RATE},
    "s": {"s": 1.0, "ms": 1e-3, "min": 60.0, "h": 3600.0},
    "Hz": {"hz": 1.0, "khz": 1e3},
    "m^2": {"m2": 1.0, "cm2": 1e-4},
    "kg m^2": {"kgm2": 1.0, "gm2": 1e-3, "kgcm2": 1e-4, "gcm2": 1e-7, "kgmm2": 1e-6, "gmm2": 1e-9},
    "kg/m^3": {"kg/m3": 1.0},
    "N": {"n": 1.0, "mn": 1e-3, "lbf": POUND_FORCE, "lb": POUND_FORCE}
    | {name: 9.80665 * size for name, size in (("kgf", 1.0), ("kg", 1.0), ("gf", 1e-3), ("g", 1e-3))},
    "N m": {"nm": 1.0, "ncm": 0.01, "mnm": 1e-3},
    "Pa": {"pa": 1.0, "hpa": 100.0, "kpa": 1e3},
    "A s": {"as": 1.0, "mah": 3.6, "ah": 3600.0},
    "mAh": {"mah": 1.0, "ah": 1e3},
    "C": {"c": 1.0},
    "ohm": {"ohm": 1.0, "ω": 1.0, "mohm": 1e-3, "mω": 1e-3},
    "rpm/V": {"rpm/v": 1.0, "kv": 1.0},
    "V": {"v": 1.0, "mv": 1e-3},
    "A": {"a": 1.0, "ma": 1e-3},
    "count": {"s": 1.0},
}
NUMBER = re.compile(r"([+-]?(?:\d+\.?\d*|\.\d+)(?:e[+-]?\d+)?)(.*)")


def parse(text: str, unit: str, bare: bool = False) -> float | None:
    """Return the number of a text in a unit of `UNITS`. Return None for other texts and units.

    Args:
        text: number and unit, for example "30 deg".
        unit: unit of the result, for example "rad".
        bare: True to accept a number alone, in `unit`.
    """
    match = NUMBER.fullmatch(text.strip().lower())
    if not match:
        return None
    written = re.sub(r"[\s^*·]", "", match[2].replace("²", "2").replace("³", "3"))
    if not written:
        return float(match[1]) if bare else None
    size = UNITS.get(unit, {}).get(written)
    return None if size is None else float(match[1]) * size
