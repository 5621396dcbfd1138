"""From a scene to what the MAVLink link knows of its vehicle."""

from cosim.scene import Scene
from dynamics.atmosphere import FREEZING, temperature
from dynamics.effects import battery
from dynamics.effects.battery_thevenin import BatteryThevenin
from dynamics.effects.payload import Payload
from dynamics.kernel import uncompiled
from services.common.environment import environment
from services.common.exchange import Exchange
from services.common.parameters import table
from services.common.vehicle import Vehicle, active, airframe, start_height
from services.mavlink.config import Mavlink
from services.mavlink.vehicle import Battery, Rotor, VehicleDescription


def resolve(scene: Scene) -> VehicleDescription | None:
    """The vehicle of a scene; None where no autopilot flies it."""
    return describe(scene) if scene.has("autopilot") else None


def describe(scene: Scene) -> VehicleDescription:
    """The vehicle of a scene that is flown."""
    frame, identity, sensors = airframe(scene), scene[Mavlink], tuple(sorted(scene.tables("sensors")))
    around = environment(scene)
    return VehicleDescription(
        name=scene[Vehicle].name,
        system=identity.system,
        flavour=identity.flavour,
        home=around.home,
        air_temperature=uncompiled(temperature)(around.atmosphere, around.home.height) - FREEZING,
        standing_height=start_height(scene),
        rotors=tuple(
            Rotor(place, turn == "ccw")
            for place, turn in zip(frame.rotors.position, frame.rotors.spin_direction, strict=True)
        ),
        max_voltage=frame.motor.max_voltage if frame.motor else None,
        battery=_battery(scene),
        sensors=sensors,
        ray_deg=_ray(scene) if "rangefinder" in sensors else (0.0, -90.0),
        flow_interval=1.0 / scene.lookup("sensors.optical_flow.rate") if "optical_flow" in sensors else 0.0,
        parameters=tuple(table(scene).values()),
        gripper=any(isinstance(effect, Payload) for effect in active(scene)),
        accepts_commands=scene.lookup("autopilot.operator"),
        tick_ns=scene[Exchange].interval_ns,
    )


def _ray(scene: Scene) -> tuple[float, float]:
    azimuth, elevation = (scene.lookup(f"sensors.rangefinder.{angle}_deg") for angle in ("azimuth", "elevation"))
    return azimuth, elevation


def _battery(scene: Scene) -> Battery | None:
    for effect in active(scene):
        if isinstance(effect, battery.Battery | BatteryThevenin):
            cells = round(effect.cells)
            charged = uncompiled(battery.open_circuit_voltage)(1.0)
            return Battery(cells, effect.capacity, effect.resistance, charged, effect.cut_off / cells)
    return None
