"""Description of a scene's vehicle for the MAVLink process."""

from lapwing.cosim.scene import Scene
from lapwing.dynamics.atmosphere import FREEZING, temperature
from lapwing.dynamics.effects import battery
from lapwing.dynamics.effects.battery_thevenin import BatteryThevenin
from lapwing.dynamics.effects.payload_release import PayloadRelease
from lapwing.kernels import python_function
from lapwing.services.common.autopilot_parameters import table
from lapwing.services.common.firmware.schema import flown_by_firmware
from lapwing.services.common.schemas.communication_schema import Communication
from lapwing.services.common.schemas.environment_schema import environment
from lapwing.services.common.schemas.vehicle_schema import Vehicle, active, airframe, start_height
from lapwing.services.mavlink.schema import Mavlink
from lapwing.services.mavlink.vehicle_description import Battery, Rotor, VehicleDescription


def resolve(scene: Scene) -> VehicleDescription | None:
    """Return the description of the vehicle. Return None without an autopilot, or with a foreign firmware."""
    return describe(scene) if scene.has("autopilot") and not flown_by_firmware(scene) else None


def describe(scene: Scene) -> VehicleDescription:
    """Return the description of the vehicle of a scene with an autopilot."""
    frame, identity, sensors = airframe(scene), scene[Mavlink], tuple(sorted(scene.tables("sensors")))
    here = environment(scene)
    return VehicleDescription(
        name=scene[Vehicle].name,
        system_id=identity.system_id,
        firmware=identity.firmware,
        home=here.home,
        air_temperature=python_function(temperature)(here.atmosphere, here.home.height) - FREEZING,
        standing_height=start_height(scene),
        rotors=tuple(
            Rotor(position, spin == "ccw")
            for position, spin in zip(frame.rotors.position, frame.rotors.spin_direction, strict=True)
        ),
        max_voltage=frame.motor.max_voltage if frame.motor else None,
        battery=_battery(scene),
        sensors=sensors,
        ray_deg=_ray(scene) if "rangefinder" in sensors else (0.0, -90.0),
        flow_interval=1.0 / scene.lookup("sensors.optical_flow.rate") if "optical_flow" in sensors else 0.0,
        parameters=tuple(table(scene).values()),
        gripper=any(isinstance(effect, PayloadRelease) for effect in active(scene)),
        accepts_commands=scene.lookup("autopilot.accept_commands"),
        tick_ns=scene[Communication].interval_ns,
    )


def _ray(scene: Scene) -> tuple[float, float]:
    azimuth, elevation = (scene.lookup(f"sensors.rangefinder.{angle}_deg") for angle in ("azimuth", "elevation"))
    return azimuth, elevation


def _battery(scene: Scene) -> Battery | None:
    for effect in active(scene):
        if isinstance(effect, battery.Battery | BatteryThevenin):
            cells = round(effect.cells)
            charged = python_function(battery.open_circuit_voltage)(1.0)
            return Battery(cells, effect.capacity, effect.resistance, charged, effect.cutoff_voltage / cells)
    return None
