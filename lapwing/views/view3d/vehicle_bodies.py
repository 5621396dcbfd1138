"""Bodies of each vehicle model, from the scene of a flight."""

from collections.abc import Callable
from typing import Any

import numpy as np

from lapwing.flights.flight_data import FlightData
from lapwing.services.common.schemas.mesh_schema import Meshes, unpack
from lapwing.views.report.style import AXIS_COLOURS, BOUND, FLOWN, QUIET
from lapwing.views.view3d.bodies import LEVEL, Body, Link, Motion, Rotor, body_of_truth, recorded_bodies
from lapwing.views.view3d.solids import THIN, Solid, ball, box, merge, raise_point, rod

FRAME, MOTOR, LEG, FRONT, PAYLOAD, HULL = "#3A4149", "#14181C", "#6B757E", "#E69F00", "#B9834B", "#C3CAD1"
MOTOR_SIDES, FOOT_SIDES = 14, 8
DENSITY = 400.0  # [kg/m^3] density of a payload or load, which defines the size of its box
GAP = 0.03  # [m] between arms and payload
CARRIER_ARM, CARRIED_EDGE = 0.2, 0.12  # [m] for a cooperative load, whose scene has masses only
SATELLITE = 1.0  # [m] longest edge of a gyrostat, whose scene has no dimensions


def motion(flight: FlightData) -> Motion:
    """Return the moving bodies of a flight in the shape of its vehicle model, by default three axes."""
    model = flight.origin.scene.get("vehicle", {}).get("model", "rigid_body")
    result = MODELS[model](flight) if model in MODELS else None
    if result is not None:
        return result
    return Motion((body_of_truth(flight, _axes(0.5, 0.015)),))


def _axes(length: float, radius: float) -> list[Solid]:
    tips = length * np.eye(3)
    return [rod((0.0,) * 3, tip, radius, colour) for tip, colour in zip(tips, AXIS_COLOURS, strict=True)]


def _multirotor(flight: FlightData) -> Motion | None:
    """Return the airframe as one body, or its recorded bodies, and a slung load."""
    scene = flight.origin.scene
    airframe = scene.get("airframe", {})
    if "rotors" not in airframe:
        return None
    centre = np.array(airframe.get("mass", {}).get("centre", (0.0, 0.0, 0.0)))  # origin of the true position
    hubs = np.array(airframe["rotors"]["position"]) - centre
    radius = 0.5 * airframe.get("propeller", {}).get("diameter", 0.8 * float(np.linalg.norm(hubs[0])))
    solids = _hull(scene, centre) or _airframe(airframe, hubs, centre, radius)
    if flight.has("body_states") and flight.topic("body_states").position.shape[1] == 1 + len(hubs):
        own = (Rotor(np.zeros(3), radius),)
        return Motion(recorded_bodies(flight, [(solids, ()), *[((), own)] * len(hubs)]))
    vehicle = body_of_truth(flight, solids, _rotors(flight, airframe, hubs, radius))
    sling = scene.get("slung_load")
    if sling is None or not flight.has("body_states"):
        return Motion((vehicle,))
    edge = (sling["mass"] / DENSITY) ** (1.0 / 3.0)
    (load,) = recorded_bodies(flight, [([box((0.0,) * 3, (edge,) * 3, PAYLOAD)], ())])
    hook = tuple((np.array(sling["hook"]) - centre).tolist())
    return Motion((vehicle, load), (Link(0, 1, hook, sling["length"]),))


def _hull(scene: dict[str, Any], centre: np.ndarray) -> list[Solid]:
    """Return the airframe's mesh relative to the centre of mass; empty without one."""
    if (name := scene["airframe"].get("mesh")) is None:
        return []
    mesh = unpack(scene[Meshes.TABLE][name])
    return [Solid(mesh.vertices - centre, mesh.faces, HULL, open=True)]


def _airframe(airframe: dict[str, Any], hubs: np.ndarray, origin: np.ndarray, radius: float) -> list[Solid]:
    """Return centre plate, arms, motors, feet and payload; `hubs` are relative to the centre of mass `origin` [m]."""
    centre, reach = hubs.mean(axis=0), float(np.linalg.norm(hubs - hubs.mean(axis=0), axis=1).max())
    thick, front = 0.045 * reach, float((hubs - centre)[:, 0].max())
    plate = np.array([0.0, 0.0, 0.5 * thick])
    nose = centre + np.array([0.3 * reach, 0.0, thick])  # in the direction of x
    solids = [
        rod(centre - plate, centre + plate, 0.3 * reach, FRAME),
        box(raise_point(centre, 1.6 * thick), (0.42 * reach, 0.22 * reach, 2.2 * thick), LEG),  # battery
        box(nose, (0.1 * reach, 0.12 * reach, 1.6 * thick), FRONT),
    ]
    for hub in hubs:
        is_front = hub[0] - centre[0] > 0.3 * front
        solids.append(
            rod(centre, raise_point(hub, -0.4 * thick), 0.5 * thick, FRONT if is_front else FRAME, sides=THIN)
        )
        solids.append(
            rod(raise_point(hub, -thick), raise_point(hub, 0.2 * thick), 0.14 * radius, MOTOR, sides=MOTOR_SIDES)
        )
    for foot in np.array(airframe.get("contact", {}).get("feet", ())).reshape(-1, 3) - origin:
        top = centre + 0.75 * (np.array([foot[0], foot[1], centre[2]]) - centre)
        solids.append(rod(top, raise_point(foot, 0.3 * thick), 0.25 * thick, LEG, sides=THIN))
        solids.append(ball(foot, 0.4 * thick, MOTOR, sides=FOOT_SIDES))
    payload = airframe.get("mass", {}).get("payload", 0.0)
    if payload > 0.0:
        edge = (payload / DENSITY) ** (1.0 / 3.0)
        solids.append(box(raise_point(centre, -GAP - edge / 2.0), (edge, edge, edge), PAYLOAD))
    return merge(solids)


def _rotors(flight: FlightData, airframe: dict[str, Any], hubs: np.ndarray, radius: float) -> list[Rotor]:
    """Return the propellers with their angles [rad] and thrusts [N] at the times of the truth."""
    count, truth = len(hubs), flight.truth
    spins = [-1.0 if way == "cw" else 1.0 for way in airframe["rotors"].get("spin_direction", ["ccw"] * count)]
    if truth.rotor_speed.ndim != 2 or truth.rotor_speed.shape[1] != count:
        return [Rotor(hub, radius, np.zeros(len(truth))) for hub in hubs]
    step = np.diff(truth.times, prepend=truth.times[0])
    angles = np.cumsum(truth.rotor_speed * step[:, None], axis=0).T
    thrusts = truth.rotor_thrust.T if "rotor_thrust" in truth.fields else [None] * count
    return [
        Rotor(hub, radius, spin * angle, thrust)
        for hub, spin, angle, thrust in zip(hubs, spins, angles, thrusts, strict=True)
    ]


def _cross(arm: float, hubs: np.ndarray) -> list[Solid]:
    """Return two crossed arms with motors; the first hub is marked as the front."""
    solids = [rod((0.0,) * 3, hub, 0.03 * arm, FRONT if k == 0 else FRAME) for k, hub in enumerate(hubs)]
    solids += [rod(raise_point(hub, -0.06 * arm), raise_point(hub, 0.02 * arm), 0.08 * arm, MOTOR) for hub in hubs]
    return merge([*solids, box((0.0,) * 3, (0.3 * arm, 0.3 * arm, 0.15 * arm), LEG)])


def _os4(flight: FlightData) -> Motion:
    """Return rotors in front, right, rear and left, numbered as in the source; the log has no rotor angles."""
    arm = flight.origin.scene["os4"]["arm"]
    hubs = arm * np.array([(1.0, 0.0, 0.0), (0.0, -1.0, 0.0), (-1.0, 0.0, 0.0), (0.0, 1.0, 0.0)])
    angles = np.zeros(len(flight.truth))
    return Motion((body_of_truth(flight, _cross(arm, hubs), [Rotor(hub, 0.6 * arm, angles) for hub in hubs]),))


def _cooperative_load(flight: FlightData) -> Motion | None:
    """Return the load as a box and the quadrotors as crosses, with a rigid link to each."""
    if not flight.has("body_states"):
        return None
    count = flight.topic("body_states").position.shape[1] - 1
    hubs = CARRIER_ARM * np.array([(1.0, 1.0, 0.0), (-1.0, 1.0, 0.0), (-1.0, -1.0, 0.0), (1.0, -1.0, 0.0)]) / np.sqrt(2)
    rotors = [Rotor(hub, 0.6 * CARRIER_ARM) for hub in hubs]
    load = [box((0.0,) * 3, (CARRIED_EDGE,) * 3, PAYLOAD)]
    bodies = recorded_bodies(flight, [(load, ()), *[(_cross(CARRIER_ARM, hubs), rotors)] * count])
    return Motion(bodies, tuple(Link(0, 1 + k) for k in range(count)))


def _gyrostat(flight: FlightData) -> Motion:
    """Return a homogeneous box; its edges a, b, c follow from the moments J: 12 J_x = m (b^2 + c^2) and so on."""
    inertia = np.array(flight.origin.scene["gyrostat"]["inertia"], float)
    squares = (inertia.sum() / 2.0 - inertia).clip(min=1e-3 * inertia.max())
    edges = SATELLITE * np.sqrt(squares / squares.max())
    return Motion((body_of_truth(flight, [box((0.0,) * 3, edges, HULL), *_axes(0.8 * SATELLITE, 0.015)]),))


def _unloading_motion(flight: FlightData) -> Motion | None:
    """Return pack, door, rollers and crate."""
    if not flight.has("body_states"):
        return None
    crate, states = flight.origin.scene["unloading"], flight.topic("body_states")
    half, count, length = crate["width"] / 2.0, states.position.shape[1], crate["door_length"]
    across = np.array((0.0, half, 0.0))
    door = [box((0.0, 0.0, length / 2.0), (0.01, 2.0 * half, length), BOUND)]
    roller = ([rod(-across, across, crate["roller_radius"], QUIET)], ())
    shapes: list[Any] = [([box((0.0,) * 3, crate["pack_size"], FLOWN)], ()), (door, ())]
    shapes += [*[roller] * (count - 3), ((), ())]
    return Motion((*recorded_bodies(flight, shapes), _crate(crate, states.times)))


def _crate(crate: dict[str, Any], times: np.ndarray) -> Body:
    tilt, half = np.radians(crate["tilt_deg"]), crate["width"] / 2.0
    back = np.array((-np.cos(tilt), 0.0, np.sin(tilt))) * crate["depth"]
    up = np.array((np.sin(tilt), 0.0, np.cos(tilt))) * crate["door_length"]
    hinge, across = np.array((0.0, 0.0, crate["floor_height"])), np.array((0.0, half, 0.0))
    corners = [hinge, hinge + back, hinge + back + up]
    edges = [(corners[k] + side * across, corners[k + 1] + side * across) for k in (0, 1) for side in (-1.0, 1.0)]
    edges += [(corner - across, corner + across) for corner in corners]
    origin, level = np.zeros((len(times), 3)), np.tile(LEVEL, (len(times), 1))
    return Body("crate", times, origin, level, tuple(merge(rod(a, b, 0.01, FRAME) for a, b in edges)))


MODELS: dict[str, Callable[[FlightData], Motion | None]] = {
    "rigid_body": _multirotor,
    "multibody": _multirotor,
    "slung_load": _multirotor,
    "os4": _os4,
    "cooperative_load": _cooperative_load,
    "gyrostat": _gyrostat,
    "unloading": _unloading_motion,
}
