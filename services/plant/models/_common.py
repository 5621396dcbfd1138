"""Resolution of a scene into the plant's configuration: common parts of all models."""

import math
from types import ModuleType
from typing import Any

from lapwing.cosim.config.run_config import ServiceConfig
from lapwing.cosim.diagram.tick_schedule import InputPort, Port
from lapwing.cosim.scene import Scene
from lapwing.dynamics import integrators
from lapwing.dynamics.config_error import ConfigError
from lapwing.dynamics.effects._hooks import initial_battery_state
from lapwing.dynamics.integrators import check_start
from lapwing.dynamics.lie.quaternion import NO_ROTATION
from lapwing.dynamics.noise import Key, stream_key
from lapwing.dynamics.vector import ZERO
from lapwing.dynamics.vehicles.ground_equilibrium import static_equilibrium
from lapwing.dynamics.vehicles.multirotor_equations import with_tolerance
from lapwing.services.common import effect_inputs, ports
from lapwing.services.common.ports import BatteryReading, BodyMotions, TrueState
from lapwing.services.common.schemas.communication_schema import Communication, Rates, ticks
from lapwing.services.common.schemas.run_schema import Run
from lapwing.services.common.schemas.vehicle_schema import Vehicle, airframe, gravity, start_pose
from lapwing.services.plant.blocks.multirotor import MultirotorPlant, MultirotorPlantState
from lapwing.services.plant.blocks.uncontrolled import AutonomousPlant
from lapwing.services.plant.encoders import PlantEncoding
from lapwing.services.plant.schema import Solver, method
from lapwing.services.plant.service_config import PlantConfig


def last_tick(scene: Scene) -> int:
    """Return the last possible tick of the run."""
    return round(scene[Run].duration * scene[Communication].rate)


def rate_ticks(scene: Scene, key: str) -> int:
    """Return the ticks between messages for a key of the table `rates`."""
    return ticks(scene, min(getattr(scene[Rates], key), scene[Communication].rate), f"rates.{key}")


def message_contents(
    scene: Scene, odometry: bool = False, battery: Any = None, bodies: tuple[str, ...] = ()
) -> PlantEncoding:
    """Return the contents of the plant's messages besides its state."""
    cells, capacity = (battery.cells, battery.capacity) if battery else (0, math.nan)
    return PlantEncoding(rate_ticks(scene, "pose"), odometry, cells, capacity, bodies)


def bodies_port(scene: Scene, n: int) -> Port:
    """Return the port of n bodies."""
    zero = (ZERO,) * n
    return Port(
        ports.BODIES, BodyMotions(zero, (NO_ROTATION,) * n, zero, zero, zero, zero), rate_ticks(scene, "body_states")
    )


def require_tables(scene: Scene, *tables: str) -> None:
    """Raise ConfigError if a scene lacks one of these optional tables."""
    for name in tables:
        if not scene.has(name):
            raise ConfigError(name, "missing", f"a table [{name}], which the model {scene[Vehicle].model} needs")


def reject_other_tables(scene: Scene, *tables: str) -> None:
    """Raise ConfigError if a scene has a model-dependent table that is not in `tables`."""
    for name in sorted({"effects", "sensors", "autopilot", "trajectory"}.difference(tables)):
        if scene.has(name) and (scene.section(name).OPTIONAL or scene.tables(name)):
            raise ConfigError(name, f"the model {scene[Vehicle].model} has no such table; remove it")


def autonomous(
    scene: Scene,
    p: Any,
    start: Any,
    truth: TrueState,
    bodies: Any = None,
    names: tuple[str, ...] = (),
    error_control: bool = False,
) -> ServiceConfig:
    """Return the configuration of a plant without commands.

    Args:
        scene: resolved scene.
        p: parameters of the system.
        start: its state at tick 0.
        truth: prototype of its output.
        bodies: parameters of the block that outputs its bodies, or None.
        names: names of the bodies.
        error_control: control the error of each step, for systems with contacts.
    """
    solver, steps, step = method(scene)
    if error_control:
        solver = integrators.StepDoubling(solver, scene[Solver].part_tolerance)
    core = AutonomousPlant(p, solver, steps, step, scene[Communication].interval, last_tick(scene))
    outputs = (Port(ports.TRUTH, truth), *([bodies_port(scene, len(names))] if bodies else []))
    return ServiceConfig(
        PlantConfig(scene[Vehicle].model, core, start, message_contents(scene, bodies=names), bodies), (), outputs
    )


def noise_key(seed: int, vehicle: str) -> Key:
    """Return the key of the plant's random numbers."""
    return stream_key(seed, vehicle, "plant")


def multirotor_plant(scene: Scene, formulation: ModuleType, p: Any) -> ServiceConfig:
    """Return the configuration of a multirotor with parameters p, as the module `formulation` describes it."""
    exchange, frame = scene[Communication], airframe(scene)
    zero = (0.0,) * len(frame.rotors.position)
    solver, steps, step = method(scene)
    key = noise_key(scene[Run].seed, scene[Vehicle].name)
    settle = round(scene[Run].stop_delay * exchange.rate)
    p = with_tolerance(p, scene[Solver].contact_tolerance)
    core = MultirotorPlant(solver, p, key, step, steps, exchange.interval, zero, settle)
    at_rest = static_equilibrium(formulation, p, start_pose(scene), gravity(scene))
    start = MultirotorPlantState(at_rest, last_tick(scene))
    truth = TrueState(
        rotor_speed=zero, motor_voltage=zero, motor_current=zero, motor_power=zero, rotor_thrust=zero, rotor_torque=zero
    )
    battery = BatteryReading(*initial_battery_state(p.effects, start.vehicle.memory, p.layout.max_voltage))
    delay, external = exchange.loop_delay, effect_inputs.ports_of(scene, p.effects)
    return ServiceConfig(
        PlantConfig("rigid_body", core, start, message_contents(scene, odometry=True, battery=frame.battery)),
        (InputPort(ports.ACTUATORS, delay), InputPort(ports.STATUS, delay), *(InputPort(i, delay) for i in external)),
        (Port(ports.TRUTH, truth), Port(ports.BATTERY, battery, rate_ticks(scene, "battery"))),
    )


def check_system(scene: Scene, p: Any, start: Any) -> None:
    """Check the initial state and the integrator.

    Raises:
        ConfigError: the initial state is invalid, or the integrator does not support such states.
    """
    model = scene[Vehicle].model
    try:
        check_start(p, start)
    except ValueError as error:
        raise ConfigError(model, str(error)) from None
    check_integrator(scene, p, start)


def check_integrator(scene: Scene, p: Any, start: Any) -> None:
    """Raise ConfigError if the integrator does not support parameters p and such states."""
    name, model = scene[Solver].integrator, scene[Vehicle].model
    if reason := integrators.incompatibility(name, p, start):
        others = ", ".join(integrators.compatible_methods(p, start))
        raise ConfigError("solver.integrator", f"{name} does not fit the model {model}: {reason}", f"one of {others}")
