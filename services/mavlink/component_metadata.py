"""Files that describe parameters, events and actuators for ground stations (MAVLink, "Component Metadata Protocol").

The format is MAVLink's component_metadata/actuators.schema.json, with the entries of PX4: QGroundControl builds its
actuator page from it. All entries are read-only, and motors cannot be run one by one.
"""

import json
from collections.abc import Mapping, Sequence
from functools import cache
from typing import Any

from lapwing.services.common.autopilot_parameters import Parameter
from lapwing.services.common.mavlink.dialect import mavlink
from lapwing.services.common.mavlink.frames import swap_body
from lapwing.services.mavlink import firmware
from lapwing.services.mavlink.events import Definition, definitions
from lapwing.services.mavlink.events.arming_checks import MODES
from lapwing.services.mavlink.events.definition import Enumeration
from lapwing.services.mavlink.file_server import crc32
from lapwing.services.mavlink.px4_facts import FIRST_MOTOR, MULTIROTOR, Fact, output_function
from lapwing.services.mavlink.vehicle_description import Rotor, VehicleDescription

EVENTS_VERSION = 2  # of libevents' format
NAMESPACE = "lapwing"


def events() -> dict[str, Any]:
    """Return the description of all events as a JSON tree."""
    all_definitions = definitions().values()
    enumerations = {
        a.type.name: a.type for d in all_definitions for a in d.arguments if isinstance(a.type, Enumeration)
    }
    groups: dict[str, Any] = {}
    for definition in all_definitions:
        groups.setdefault(definition.group, {"events": {}})["events"][str(definition.sub_id)] = _event(definition)
    numbers = {mode.kind: mode.number for mode in reversed(firmware.get("px4").MODES)}
    component = {
        "namespace": NAMESPACE,
        "enums": {name: _enumeration(e) for name, e in enumerations.items()},
        "event_groups": groups,
        "navigation_mode_groups": {"groups": {str(k): [numbers[mode]] for k, mode in enumerate(MODES)}},
        "supported_protocols": ["health_and_arming_check"],
    }
    return {"version": EVENTS_VERSION, "components": {str(mavlink.MAV_COMP_ID_AUTOPILOT1): component}}


def _event(d: Definition) -> dict[str, Any]:
    entry: dict[str, Any] = {"name": d.name, "message": d.message}
    if d.description:
        entry["description"] = d.description
    if d.type:
        entry["type"] = d.type
    if d.arguments:
        types = [a.type.name if isinstance(a.type, Enumeration) else a.type for a in d.arguments]
        entry["arguments"] = [{"name": a.name, "type": kind} for a, kind in zip(d.arguments, types, strict=True)]
    return entry


def _enumeration(e: Enumeration) -> dict[str, Any]:
    entries = {str(entry.value): {"name": entry.name, "description": entry.text} for entry in e.entries}
    return {"type": e.type, "is_bitfield": e.bits, "entries": entries}


FILES_VERSION = 2  # of the format of each file
_STOPPED, _FULL = 0.0, 1.0


def actuators(rotors: Sequence[Rotor]) -> dict[str, Any]:
    """Return the description of the motors as a JSON tree."""
    numbers = range(1, len(rotors) + 1)
    channel = {"name": output_function("${i}"), "label": "Function", "function": "function"}
    channels = [{"label": f"Channel {n}", "param-index": n} for n in numbers]
    functions: dict[str, Any] = {"0": {"label": "Disabled"}}
    for n in numbers:
        functions[str(FIRST_MOTOR + n - 1)] = {"label": f"Motor {n}", "exclude-from-actuator-testing": True}
    return {
        "version": FILES_VERSION,
        "outputs_v1": [
            {"label": "Simulation", "subgroups": [{"per-channel-parameters": [channel], "channels": channels}]}
        ],
        "functions_v1": functions,
        "mixer_v1": {
            "actuator-types": {
                "DEFAULT": {"values": {"min": _STOPPED, "max": _FULL}},
                "motor": {
                    "function-min": FIRST_MOTOR,
                    "function-max": FIRST_MOTOR + len(rotors) - 1,
                    "label-index-offset": 1,
                    "values": {"min": _STOPPED, "max": _FULL, "default": _STOPPED},
                },
            },
            "config": [_geometry(rotors)],
        },
    }


def _geometry(rotors: Sequence[Rotor]) -> dict[str, Any]:
    """Return the rotor geometry in FRD axes, as in PX4."""
    x, y, z = zip(*(swap_body(rotor.position_body) for rotor in rotors), strict=True)
    directions = [float(rotor.counterclockwise) for rotor in rotors]
    values = {
        "posx": ("Position X", x),
        "posy": ("Position Y", y),
        "posz": ("Position Z", z),
        "spin-dir": ("Direction CCW", directions),
    }
    return {
        "option": f"CA_AIRFRAME=={MULTIROTOR}",
        "type": "multirotor",
        "title": "Multirotor",
        "actuators": [
            {
                "group-label": "Motors",
                "actuator-type": "motor",
                "required": True,
                "count": len(rotors),
                "per-item-parameters": [
                    {"label": label, "function": function, "value": list(value)}
                    for function, (label, value) in values.items()
                ],
            }
        ],
    }


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
    entry = _entry(p.name, p.integer, p.unit, p.meaning[:1].upper() + p.meaning[1:], p.default)
    limits = {"min": _number(p.least, p.integer), "max": _number(p.most, p.integer)}
    return entry | limits | ({"rebootRequired": True} if p.at_start else {})


def _fact(fact: Fact, value: float) -> dict[str, Any]:
    if fact.assign is None:
        text = "Property of the vehicle (read-only)"
        return _entry(fact.name, fact.integer, fact.unit, text, value) | {"readOnly": True}
    entry = _entry(fact.name, fact.integer, fact.unit, "As in PX4", value)
    return entry | ({"rebootRequired": True} if fact.at_reboot else {})


def _entry(name: str, integer: bool, unit: str, text: str, default: float) -> dict[str, Any]:
    return {
        "name": name,
        "type": "Int32" if integer else "Float",
        "shortDesc": text,
        "units": unit,
        "group": name.partition("_")[0],
        "category": "Standard",
        "decimalPlaces": 0 if integer else 3,
        "default": _number(default, integer),
    }


def _number(value: float, integer: bool) -> float | int:
    return round(value) if integer else value
