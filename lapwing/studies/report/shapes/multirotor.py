"""A multirotor from its airframe: arms, turning rotors, feet, payload, or its mesh; one body or five; a slung load."""

import numpy as np

from lapwing.services.common.mesh_schema import Meshes, unpack
from lapwing.studies.flight_data import FlightData
from lapwing.studies.report.motion_3d import Body, Link, Motion, Rotor, Stroke, Surface, of_bodies, of_truth
from lapwing.studies.report.shapes._outlines import box
from lapwing.studies.report.style import BOUND, COLOURS, QUIET

MODELS = ("rigid_body", "multibody", "slung_load")
DENSITY = 400.0  # [kg/m^3] of a payload or load, which fixes the size of its box
GAP = 0.03  # [m] between the arms and the payload
HULL = "#C3CAD1"  # of a mesh


def draw(flight: FlightData) -> Motion | None:
    """The airframe where the truth has it; where five bodies were recorded, each of them; and what hangs on it."""
    airframe = flight.origin.scene.get("airframe", {})
    if "rotors" not in airframe:
        return None
    centre = np.array(airframe.get("mass", {}).get("centre", (0.0, 0.0, 0.0)))  # where the truth has the vehicle
    hubs = np.array(airframe["rotors"]["position"]) - centre
    radius = 0.5 * airframe.get("propeller", {}).get("diameter", 0.8 * float(np.linalg.norm(hubs[0])))
    surface = _surface(flight.origin.scene, centre)
    strokes = () if surface else _frame(airframe, hubs, centre)
    if flight.has("body_states") and flight.topic("body_states").position.shape[1] == 1 + len(hubs):
        own = (Rotor(np.zeros(3), radius),)
        base, *others = of_bodies(flight, [(strokes, ()), *[((), own)] * len(hubs)])
        return Motion((base._replace(surface=surface), *others))
    spins = [-1.0 if way == "cw" else 1.0 for way in airframe["rotors"].get("spin_direction", ["ccw"] * len(hubs))]
    rotors = tuple(
        Rotor(hub, radius, spin * angle)
        for hub, spin, angle in zip(hubs, spins, _angles(flight, len(hubs)), strict=False)
    )
    vehicle, sling = of_truth(flight, strokes, rotors, surface), flight.origin.scene.get("slung_load")
    if sling is None or not flight.has("body_states"):
        return Motion((vehicle,))
    hook = np.array(sling["hook"]) - centre
    return Motion((vehicle, _load(flight, sling)), (Link(0, 1, tuple(hook.tolist()), sling["length"]),))


def _surface(scene: dict, centre: np.ndarray) -> Surface | None:
    """The mesh that the airframe names, measured from the centre of mass."""
    if (name := scene["airframe"].get("mesh")) is None:
        return None
    mesh = unpack(scene[Meshes.TABLE][name])
    return Surface(mesh.vertices - centre, mesh.faces, HULL)


def _load(flight: FlightData, sling: dict) -> Body:
    edge = (sling["mass"] / DENSITY) ** (1.0 / 3.0)
    return of_bodies(flight, [((Stroke(box(edge, edge, edge), BOUND),), ())])[0]


def _frame(airframe: dict, hubs: np.ndarray, origin: np.ndarray) -> tuple[Stroke, ...]:
    """Arms, nose, feet and payload, of hubs that are measured from the centre of mass `origin`."""
    centre = hubs.mean(axis=0)
    strokes = [Stroke(np.array([centre, hub]), width=6.0) for hub in hubs]
    nose = centre + np.array([0.6 * float(np.abs(hubs[:, 0]).max()), 0.0, 0.0])
    strokes.append(Stroke(np.array([centre, nose]), COLOURS[1], 6.0))  # where x points
    for foot in np.array(airframe.get("contact", {}).get("feet", ())).reshape(-1, 3) - origin:
        strokes.append(Stroke(np.array([[foot[0], foot[1], centre[2]], foot]), QUIET))
    payload = airframe.get("mass", {}).get("payload", 0.0)
    if payload > 0.0:
        edge = (payload / DENSITY) ** (1.0 / 3.0)
        strokes.append(Stroke(box(edge, edge, edge) + centre - (0.0, 0.0, GAP + edge / 2.0), COLOURS[1], 3.0))
    return tuple(strokes)


def _angles(flight: FlightData, count: int) -> np.ndarray:
    """Return the angle of each rotor [rad] at the times of the truth, shape (count, n)."""
    speed = flight.truth.rotor_speed
    if speed.ndim != 2 or speed.shape[1] != count:
        return np.zeros((count, len(flight.truth)))
    step = np.diff(flight.truth.times, prepend=flight.truth.times[0])
    return np.cumsum(speed * step[:, None], axis=0).T
