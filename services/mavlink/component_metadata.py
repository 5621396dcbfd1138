"""Files that describe the parameters for ground stations (MAVLink guide, "Component Metadata Protocol")."""

import json
from collections.abc import Mapping
from functools import cache
from typing import Any

from lapwing.services.common.autopilot_parameters import Parameter
from lapwing.services.mavlink import firmware
from lapwing.services.mavlink.actuator_metadata import actuators
from lapwing.services.mavlink.event_metadata import events
from lapwing.services.mavlink.file_server import crc32
from lapwing.services.mavlink.px4_facts import Fact, output_function
from lapwing.services.mavlink.vehicle_description import VehicleDescription

GENERAL, PARAMETERS = "etc/extras/component_general.json", "etc/extras/parameters.json"
EVENTS, ACTUATORS = "etc/extras/all_events.json", "etc/extras/actuators.json"
PARAMETER_TYPE, EVENTS_TYPE, ACTUATORS_TYPE = 1, 4, 5  # COMP_METADATA_TYPE


def uri(path: str) -> str:
    """Return the URI of a file path."""
    return f"mftp://{path}"


@cache
def files(description: VehicleDescription) -> Mapping[str, bytes]:
    """Return the metadata files of a vehicle by path."""
    table = {p.name: _parameter(p) for p in description.parameters}
    values = {p.name: p.default for p in description.parameters}
    emulated = firmware.get(description.firmware)
    for fact in emulated.facts(description):
        table.setdefault(fact.name, _fact(fact, fact.value(values)))
    parameters = _json({"version": 1, "parameters": [table[name] for name in sorted(table)]})
    contents = {PARAMETERS: (PARAMETER_TYPE, parameters)}
    if emulated.EVENTS:
        contents[EVENTS] = EVENTS_TYPE, _json(events())
    if output_function(1) in table:  # ArduPilot's parameters have no such page
        contents[ACTUATORS] = ACTUATORS_TYPE, _json(actuators(description.rotors))
    types = [{"type": kind, "uri": uri(path), "fileCrc": crc32(content)} for path, (kind, content) in contents.items()]
    general = {"version": 1, "vendorName": "Lapwing", "modelName": description.name, "metadataTypes": types}
    return {GENERAL: _json(general)} | {path: content for path, (_, content) in contents.items()}


def _json(value: Any) -> bytes:
    return json.dumps(value, separators=(",", ":"), allow_nan=False).encode()


def _parameter(p: Parameter) -> dict[str, Any]:
    entry = _entry(p.name, p.whole, p.unit, p.meaning[:1].upper() + p.meaning[1:], p.default)
    limits = {"min": _number(p.least, p.whole), "max": _number(p.most, p.whole)}
    return entry | limits | ({"rebootRequired": True} if p.at_start else {})


def _fact(fact: Fact, value: float) -> dict[str, Any]:
    if fact.assign is None:
        text = "Property of the vehicle (read-only)"
        return _entry(fact.name, fact.whole, fact.unit, text, value) | {"readOnly": True}
    entry = _entry(fact.name, fact.whole, fact.unit, "As in PX4", value)
    return entry | ({"rebootRequired": True} if fact.at_reboot else {})


def _entry(name: str, whole: bool, unit: str, text: str, default: float) -> dict[str, Any]:
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
