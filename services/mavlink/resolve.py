"""From a scene to what the MAVLink link knows of its vehicle."""

from cosim.scene import Scene
from dynamics.effects import battery
from dynamics.effects.payload import Payload
from services.common.exchange import Exchange
from services.common.parameters import table
from services.common.vehicle import Vehicle, active, airframe, start_height
from services.mavlink.config import Mavlink
from services.mavlink.vehicle import Battery, VehicleDescription


def resolve(scene: Scene) -> VehicleDescription | None:
    """The vehicle of a scene; None where no autopilot flies it."""
    return describe(scene) if scene.has("autopilot") else None


def describe(scene: Scene) -> VehicleDescription:
    """The vehicle of a scene that is flown."""
    frame, identity, sensors = airframe(scene), scene[Mavlink], tuple(sorted(scene.tables("sensors")))
    return VehicleDescription(
        name=scene[Vehicle].name,
        system=identity.system,
        flavour=identity.flavour,
        standing_height=start_height(scene),
        rotors=len(frame.rotors.position),
        max_voltage=frame.motor.max_voltage if frame.motor else None,
        battery=_battery(scene),
        sensors=sensors,
        parameters=tuple(table(scene).values()),
        gripper=any(isinstance(effect, Payload) for effect in active(scene)),
        accepts_commands=scene.lookup("autopilot.operator"),
        tick_ns=scene[Exchange].interval_ns,
    )


def _battery(scene: Scene) -> Battery | None:
    for effect in active(scene):
        if isinstance(effect, battery.Battery):
            cells = round(effect.cells)
            charged = battery.open_circuit_voltage(1.0)
            return Battery(cells, effect.capacity, effect.resistance, charged, effect.cut_off / cells)
    return None
