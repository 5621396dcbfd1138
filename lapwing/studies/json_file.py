"""Results of studies as JSON."""

import json
import math
from pathlib import Path
from typing import Any

from lapwing.cosim.complete_file import write_text


def write_json(path: Path, data: Any) -> None:
    """Write data: NamedTuples become objects, arrays become lists, and numbers that are not finite become null."""
    write_text(path, json.dumps(_plain(data), indent=2, allow_nan=False) + "\n")


def _plain(value: Any) -> Any:
    if hasattr(value, "tolist"):  # an array or a scalar of NumPy
        value = value.tolist()
    if hasattr(value, "_asdict"):
        value = value._asdict()
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
