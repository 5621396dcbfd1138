"""Planned faults of a scene: rotor damage, broken propellers, sensor faults."""

import math
from typing import Any


def planned(scene: dict[str, Any]) -> list[tuple[float, str]]:
    """Time [s] and description of each fault of a scene's tables, in order."""
    found: list[tuple[float, str]] = []
    damage = scene.get("effects", {}).get("rotor_damage")
    if damage is not None:
        left = damage.get("remaining_thrust", 0.0)
        found.append((damage.get("time", 0.0), f"rotor {damage.get('rotor')} keeps {100.0 * left:g} % of its thrust"))
    for event in scene.get("multibody", {}).get("event", ()):
        found.append((event["time"], f"propeller {event['propeller']} becomes {event['becomes'].replace('_', ' ')}"))
    for sensor, table in scene.get("sensors", {}).items():
        for fault in table.get("faults", ()) if isinstance(table, dict) else ():
            start, stop = fault.get("start", 0.0), fault.get("stop", math.inf)
            which = "" if fault.get("channel", "all") == "all" else f" of {fault['channel']}"
            until = f" until {stop:g} s" if stop < math.inf else ""
            found.append((start, f"{sensor}: {fault['kind']}{which}{until}"))
    return sorted(found)
