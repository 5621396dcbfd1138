"""Header of the flight report."""

from collections.abc import Iterator
from typing import Any

from lapwing.cosim.executors.realtime import MISSED, WORST
from lapwing.flights.flight_data import FlightData
from lapwing.flights.flight_provenance import solver_and_exchange

LONG = 60  # largest number of characters of a value, or of an effect's keys
MANY = 12  # largest number of keys in which two scenes differ that are listed openly
LONGEST = 500  # largest number of characters of a value in which they differ


def facts(flight: FlightData) -> dict[str, str]:
    """Return facts on the vehicle and its simulation by name; facts missing in the log are omitted."""
    metadata, scene = flight.metadata, flight.origin.scene
    t = flight.truth.times
    vehicle, autopilot = scene.get("vehicle", {}), scene.get("autopilot", {})
    kind = vehicle.get("airframe") or vehicle.get("model", "")
    mass = scene.get("airframe", {}).get("mass", {}).get("total")
    has_autopilot = "autopilot" in flight.origin.scene and flight.has("actuators")
    table = {
        "scene": metadata.get("scene", ""),
        "log": flight.origin.source if flight.origin.recorded else "",
        "vehicle": ", ".join(filter(None, (flight.vehicle, kind, f"{mass:g} kg" if mass else ""))),
        "effects": "; ".join(
            _with_keys(name, keys) for name, keys in scene.get("effects", {}).items() if keys is not False
        ),
        "sensors": "; ".join(_with_keys(name, keys) for name, keys in scene.get("sensors", {}).items()),
        "estimator": str(autopilot.get("estimator", "")) if has_autopilot else "",
        "controller": str(autopilot.get("controller") or "cascaded PID") if has_autopilot else "",
        "gains": _gains(scene) if has_autopilot and uses_gains(scene) else "",
        "duration": f"{t[-1] - t[0]:.2f} s",
        "landed": "yes" if flight.landed else "no" if flight.has("status") else "",
        "seed": metadata.get("seed", ""),
        "mode": metadata.get("mode", ""),
        **solver_and_exchange(metadata),
        "deadlines missed": f"{metadata[MISSED]} ticks; at most {metadata[WORST]} late" if MISSED in metadata else "",
        "imported from": metadata.get("imported_from", ""),
        "marked samples": metadata.get("faults", ""),
        "notes": metadata.get("notes", ""),
        "version": metadata.get("version", ""),
        "commit": metadata.get("commit", ""),
        "digest": flight.digest or "none: the log is incomplete",
    }
    return {name: value for name, value in table.items() if value}


def differences(one: dict[str, Any], other: dict[str, Any]) -> dict[str, tuple[str, str]]:
    """Return both values of the keys in which two scenes differ; the tables of a list have their index as key."""
    first, second = (_leaves_in_use(scene, uses_gains(one) and uses_gains(other)) for scene in (one, other))
    keys = [key for key in {**first, **second} if first.get(key) != second.get(key)]
    return {key: (cut(first.get(key, ""), LONGEST), cut(second.get(key, ""), LONGEST)) for key in keys}


def _leaves(table: dict[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    """Yield dotted key and value of all leaves without empty lists; an effect or sensor without keys is "yes"."""
    for key, value in table.items():
        if isinstance(value, list | tuple) and value and all(isinstance(item, dict) for item in value):
            value = {str(k): item for k, item in enumerate(value)}
        if isinstance(value, dict) and value:
            yield from _leaves(value, f"{prefix}{key}.")
        elif isinstance(value, dict):
            if prefix:
                yield f"{prefix}{key}", "yes"
        elif value is not None and value != []:
            yield f"{prefix}{key}", value


def uses_gains(scene: dict[str, Any]) -> bool:
    """Return True if the vehicle has the cascaded controller, to which the scene's gain set belongs."""
    return not scene.get("autopilot", {}).get("controller")


def _leaves_in_use(scene: dict[str, Any], gains: bool) -> dict[str, Any]:
    """Return the leaves of a scene that affect a flight; those of the gain set only if `gains`."""
    unused = ("published.", "run.title", *(() if gains else ("gains.", "autopilot.gains")))
    return {key: value for key, value in _leaves(scene) if not key.startswith(unused)}


def _gains(scene: dict[str, Any]) -> str:
    name, text = str(scene["autopilot"].get("gains", "")), scene.get("gains", {}).get("description", "")
    return f"{name}: {text}" if name and text else name


def _with_keys(name: str, keys: dict[str, Any]) -> str:
    text = ", ".join(f"{key} {_short(value)}" for key, value in keys.items())
    return f"{name} ({text if len(text) <= LONG else f'{len(keys)} keys'})" if text else name


def cut(value: Any, longest: int = LONG) -> str:
    """Return a value as text, cut to `longest` characters: a module's source or a mesh has thousands."""
    text = _short(value)
    return text if len(text) <= longest else f"{text[:longest]}…"


def _short(value: Any) -> str:
    """Return a value as in a scene file; a text without quotes."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(_short, value))}]"
    return f"{value:g}" if isinstance(value, float) else str(value)
