"""Present names of modules, classes, fields, scene keys and values in logs that were recorded under former names.

`former_names.toml` has the names. It is read only if a name is not a present one, since every process start decodes a
run configuration.
"""

import importlib
import math
import re
import tomllib
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

FORMER_PACKAGES = ("cosim", "dynamics", "messages", "services", "studies")  # top-level before the move to lapwing
COUPLINGS = {"sequential": "gauss_seidel", "parallel": "jacobi"}
DIRECTIONS = ("forward", "backward", "right", "left", "vertical")  # keys of the static pressure error of a barometer
ANCHOR = 5  # numbers in the memory of a foot in former versions
METADATA = {"coupling": COUPLINGS, "mode": {"processes": "multi-process", "single": "single-process"}}


@cache
def former_names() -> dict[str, Any]:
    """Return the tables of `former_names.toml`."""
    return tomllib.loads(Path(__file__).with_suffix(".toml").read_text(encoding="utf-8"))


def present_name(name: str) -> str:
    """Return the present "module:Class" of a recorded one; unchanged if it was never renamed."""
    module, _, path = name.partition(":")
    if module.partition(".")[0] in FORMER_PACKAGES:
        module = f"lapwing.{former_names()['modules'].get(module, module)}"
    return f"{module}:{former_names()['classes'].get(f'{module}:{path}', path)}"


def present_fields(class_path: str, members: Mapping[str, Any]) -> dict[str, Any]:
    """Return the members of a recorded object of the present "module:Class" by the present names of its fields."""
    renamed, added = (former_names()[kind].get(class_path, {}) for kind in ("fields", "added"))
    added = {key: tuple(value) if isinstance(value, list) else value for key, value in added.items()}
    present = added | {renamed.get(key, key): value for key, value in members.items()}
    if class_path.endswith(":GroundContact") and (square := present.pop("square_stiction_velocity", None)):
        # an anchor with a flag became friction elements
        present |= {"tangential_damping": present["damping"], "inverse_stiction": 1.0 / math.sqrt(square)}
    module, _, name = class_path.partition(":")
    if name == "Barometer" and "static_pressure_error" not in present:  # the same share in all directions
        share, kind = present.pop("airspeed_error"), importlib.import_module(module).StaticPressureError
        present["static_pressure_error"] = kind(*[share] * len(DIRECTIONS)) if share else None
    return present


def present_state(value: Any) -> Any:
    """Return a recorded value with friction elements at rest in place of the anchor and flag of each foot."""
    if type(value).__name__ == "MultirotorState":
        feet = [bool(m) and all(isinstance(f, tuple) and len(f) == ANCHOR for f in m) for m in value.memory]
        memory = zip(feet, value.memory, strict=True)
        return value._replace(memory=tuple(((0.0, 0.0, 0.0),) * len(m) if former else m for former, m in memory))
    if not isinstance(value, tuple):
        return value
    parts = tuple(map(present_state, value))
    if all(a is b for a, b in zip(parts, value, strict=True)):
        return value
    return type(value)(*parts) if hasattr(value, "_fields") else parts


def present_tables(tree: Mapping[str, Any]) -> dict[str, Any]:
    """Return the resolved tables of a scene, of one vehicle or of a fleet, under their present names."""
    names = former_names()
    present: dict[str, Any] = {}
    for former, value in tree.items():
        name = names["tables"].get(former, former)
        if name == "vehicle" and isinstance(value, list):
            present[name] = [present_tables(entry) for entry in value]
        else:
            present[name] = _rename(value, *(names[kind].get(name, {}) for kind in ("keys", "values", "removed")))
    barometer = present.get("sensors", {}).get("barometer", {})
    if "airspeed_error" in barometer:
        barometer["static_pressure_error"] = dict.fromkeys(DIRECTIONS, barometer.pop("airspeed_error"))
    if isinstance(success := present.get("success"), dict):
        present["success"] = success | {"require": [_criterion(text) for text in success.get("require", ())]}
    return present


def present_metadata(metadata: Mapping[str, str]) -> dict[str, str]:
    """Return the metadata of a log with the present names of its values."""
    return {key: METADATA.get(key, {}).get(value, value) for key, value in metadata.items()}


def present_config(config: Any) -> Any:
    """Return a recorded `RunConfig` with the present names of its tables and coupling."""
    coupling = COUPLINGS.get(config.coupling, config.coupling)
    services = {name: present_state(service) for name, service in config.services.items()}
    return config._replace(resolved=present_tables(config.resolved), coupling=coupling, services=services)


def _criterion(text: str) -> str:
    for criterion in former_names()["criteria"]:
        text = re.sub(criterion["pattern"], criterion["replacement"], text)
    return text


def _rename(value: Any, keys: Mapping[str, str], values: Mapping[str, Mapping[str, str]], removed: list[str]) -> Any:
    if isinstance(value, list):
        return [_rename(item, keys, values, removed) for item in value]
    if not isinstance(value, dict):
        return value
    present = {}
    for former, item in value.items():
        name = keys.get(former, former)
        if name not in removed:
            item = _rename(item, keys, values, removed)
            present[name] = values.get(name, {}).get(item, item) if isinstance(item, str) else item
    return present
