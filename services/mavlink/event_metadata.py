"""Event metadata for ground stations, in libevents' JSON format, version 2."""

from typing import Any

from lapwing.services.common.mavlink.dialect import mavlink
from lapwing.services.mavlink import firmware
from lapwing.services.mavlink.events import Definition, definitions
from lapwing.services.mavlink.events.arming_checks import MODES
from lapwing.services.mavlink.events.definition import Enumeration

VERSION = 2
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
    return {"version": VERSION, "components": {str(mavlink.MAV_COMP_ID_AUTOPILOT1): component}}


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
