"""Files that tell ground stations what the parameters mean (MAVLink guide, "Component Metadata Protocol")."""

import json
from collections.abc import Mapping
from functools import cache
from typing import Any

from services.common.parameters import Parameter
from services.mavlink import flavours
from services.mavlink.file_server import crc32
from services.mavlink.px4_facts import Fact
from services.mavlink.vehicle import VehicleDescription

GENERAL, PARAMETERS = "etc/extras/component_general.json", "etc/extras/parameters.json"
EVENTS = "etc/extras/all_events.json"
PARAMETER_TYPE, EVENTS_TYPE = 1, 4  # COMP_METADATA_TYPE
_NO_EVENTS = {
    "version": 2,
    "components": {"1": {"namespace": "lapwing", "event_groups": {}}},
}  # texts tell what happens


def uri(path: str) -> str:
    """Where a file is, as messages and files name it."""
    return f"mftp://{path}"


@cache
def files(description: VehicleDescription) -> Mapping[str, bytes]:
    """The files of a vehicle by their paths."""
    table = {p.name: _parameter(p) for p in description.parameters}
    values = {p.name: p.default for p in description.parameters}
    for fact in flavours.get(description.flavour).facts(description):
        table.setdefault(fact.name, _fact(fact, fact.value(values)))
    parameters = _json({"version": 1, "parameters": [table[name] for name in sorted(table)]})
    events = _json(_NO_EVENTS)
    types = [
        {"type": PARAMETER_TYPE, "uri": uri(PARAMETERS), "fileCrc": crc32(parameters)},
        {"type": EVENTS_TYPE, "uri": uri(EVENTS), "fileCrc": crc32(events)},
    ]
    general = {"version": 1, "vendorName": "Lapwing", "modelName": description.name, "metadataTypes": types}
    return {GENERAL: _json(general), PARAMETERS: parameters, EVENTS: events}


def _json(value: Any) -> bytes:
    return json.dumps(value, separators=(",", ":"), allow_nan=False).encode()


def _parameter(p: Parameter) -> dict[str, Any]:
    found = _described(p.name, p.whole, p.unit, p.meaning[:1].upper() + p.meaning[1:], p.default)
    return found | {"min": _number(p.least, p.whole), "max": _number(p.most, p.whole)}


def _fact(fact: Fact, value: float) -> dict[str, Any]:
    return _described(fact.name, fact.whole, fact.unit, "A fact of the vehicle; cannot be changed", value)


def _described(name: str, whole: bool, unit: str, text: str, default: float) -> dict[str, Any]:
    return {
        "name": name,
        "type": "Int32" if whole else "Float",
        "shortDesc": text,
        "units": unit,
        "group": name.partition("_")[0],
        "category": "Standard",
        "decimalPlaces": 0 if whole else 3,
        "default": _number(default, whole),
    }


def _number(value: float, whole: bool) -> float | int:
    return round(value) if whole else value
