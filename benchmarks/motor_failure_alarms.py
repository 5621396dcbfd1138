"""False alarms and detection times of the motor failure detector on vehicles that differ from its model.

    python -m benchmarks.motor_failure_alarms [AIRFRAMES...] [--flights N] [--first K]

Mass, inertia, thrust, gains, centre of mass, charge, wind, gusts and course of every flight are random, up to the
airspeed at which drag turns the vehicle like half of a rotor's thrust. Odd flights lose all, or half, of the
thrust of a rotor at a random time in the air. An alarm before that, or of another rotor, is false. Flights of vehicles
that have turned over before, or are not in the air at the failure, do not count, nor do losses of a rotor that idles
until the end: nothing depends on it, and nothing shows them. A slow turn of `crazyflie_21` idles two of its rotors.
"""

import time
from collections import Counter
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated, Any, NamedTuple

import numpy as np
import typer

from benchmarks._command import command_line
from benchmarks._targets import Row, show
from lapwing.cli.new_vehicle import write_vehicle
from lapwing.cosim.config.run_config import RunConfig
from lapwing.cosim.scene import Scene
from lapwing.dynamics.effects import from_scene
from lapwing.dynamics.vehicles.multirotor import initial_state, observe, parameters
from lapwing.kernels.row_packing import columns
from lapwing.services.autopilot import motor_failure
from lapwing.services.autopilot.block import FLIGHT
from lapwing.services.autopilot.controller_parameters import Airframe
from lapwing.services.autopilot.gains import GainSet
from lapwing.services.autopilot.nominal_airframe import known_airframe
from lapwing.services.common.ports import ACTUATORS, TRUTH
from lapwing.services.common.schemas.environment_schema import environment
from lapwing.services.common.schemas.vehicle_schema import Effects, airframe
from lapwing.services.scene_resolver import load
from lapwing.studies.campaign.campaign_config import campaign_config
from lapwing.studies.simulate import fly_with_ports
from lapwing.studies.tune.bandwidths import Bandwidths
from lapwing.studies.tune.corners import Corner, with_gains, with_vehicle
from lapwing.studies.tune.design import design, gain_set
from lapwing.studies.tune.linearise import hover

OWN = "hexa5"  # written by `lapwing new vehicle`, with designed gains
MOST_AIRSPEED = 20.0  # [m/s]; half of it is mean wind, a quarter gust and about a quarter ground speed
MOST_TORQUE = 0.5  # of the drag at the largest airspeed, over that of one rotor in hover
COURSE = 0.4  # [s] largest way ahead over the airspeed: a peak of 0.28 of it
SCENES = {
    "crazyflie_21": "crazyflie_21", "delivery_drone": "hover", "hexacopter": "hexacopter", "os4": "os4_hover",
    "quad_x": "quad_x", "racer_250": "racer_250", OWN: "hover",
}  # fmt: skip
EFFECTS: dict[str, dict[str, Any]] = {
    "air_density": {}, "gyroscopic_torque": {}, "ground_contact": {}, "battery": {}, "body_wrench": {},
    "wind_constant": {"velocity": [0.0, 0.0, 0.0]}, "wind_dryden": {"wind_speed": 1.0},
    "wind_gust": {"peak": [0.0, 0.0, 0.0], "start": 1.0, "duration": 1.0},
    "rotor_damage": {"rotor": 1, "time": 1e3},
    "h_force": {}, "body_drag": {},
}  # fmt: skip
DRAG = ("gravity", "air_density", "rotor_thrust", "rotor_quadratic", "h_force", "body_drag", "rotational_drag")
SENSORS: dict[str, Any] = {
    "imu": {"preset": "mpu6000"}, "magnetometer": {}, "gps": {"preset": "rtk"}, "barometer": {},
}  # fmt: skip
FIRST, LAST, AFTER = 2.5, 15.5, 2.0  # [s] range of the time of failure, and flight after it
ALOFT = 0.5  # [m] height in which a failure can be detected
IDLE = 0.1  # fraction of the thrust in hover below which a rotor idles
HALF = 0.5  # remaining thrust of a partial loss


def phases(height: float, course: float, shake: float) -> list[dict[str, Any]]:
    """Return the trajectory: up, hover, ahead and aside with a turn, to and fro, down; [m]."""

    def move(name: str, duration: float, **to: float) -> dict[str, Any]:
        axes = {axis: {"kind": "minimum_jerk", "to": value, "duration": duration} for axis, value in to.items()}
        return {"name": name, **axes}

    def chirp(axis: str) -> dict[str, Any]:
        form = {"kind": "chirp", "amplitude": shake, "start_frequency": 0.4, "end_frequency": 1.3, "duration": 3.0}
        return {"name": axis, axis: form}

    return [
        {"name": "rest", "duration": 0.5}, move("climb", 2.5, z=height), {"name": "hover", "duration": 1.5},
        move("out", 3.0, x=course, y=0.5 * course, yaw=1.0), chirp("x"), chirp("y"),
        move("descend", 3.5, z=0.0), {"name": "land", "duration": 2.0},
    ]  # fmt: skip


class Draw(NamedTuple):
    """Random values of a flight."""

    corner: Corner
    gains: float  # factor of the gains
    overrides: dict[str, Any]
    rotor: int  # that fails, from 1; 0: none
    moment: float  # [s] of the failure
    remaining: float  # fraction of its thrust


class Alarm(NamedTuple):
    """First alarm of a flight."""

    held: bool  # the vehicle was upright until the failure, or the end, and in the air with the rotor at the failure
    rotor: int  # from 1; 0: none
    moment: float  # [s]


def largest_airspeed(scene: Scene) -> float:
    """Return the airspeed [m/s] at which drag turns the vehicle like `MOST_TORQUE` of a rotor's thrust in hover."""
    model, frame = hover(scene), airframe(scene)
    effects = {k: t for k, t in scene[Effects].tables.items() if k in DRAG}
    p = parameters(frame, from_scene(effects, frame, environment(scene)))
    known = known_airframe(scene)
    detector = motor_failure.build(known, np.inf, {})
    rotor = max(abs(pitch) for pitch in detector.pitch) * detector.hover_thrust  # [rad/s^2]
    volts = (model.voltage,) * len(known.rotor_x)

    def turn(speed: float) -> float:
        state = initial_state(p, (0.0, 0.0, 50.0), rotor_speed=model.rotor_speed, velocity_world=(speed, 0.0, 0.0))
        return abs(observe(p, 0, 0.004, state, volts).angular_acceleration_body[1])

    speeds = np.linspace(0.0, MOST_AIRSPEED, 201)
    return float(max(v for v in speeds if turn(v) <= MOST_TORQUE * rotor))


class Bench:
    """Flights of one airframe."""

    def __init__(self, name: str, folder: Path):
        """Load the scene; `folder` for the files of the vehicle that `lapwing new` writes."""
        own: dict[str, Any] = {}
        if name == OWN:
            path, *_ = write_vehicle(name, {"rotors": 6.0, "mass": 5.0}, folder)
            own = {"vehicle.airframe": str(path)}
        base = load(SCENES[name], own)
        given = base.resolved["effects"]
        propeller = "rotor_thrust" in given
        left_out = set() if propeller else {"h_force", "body_drag", "air_density"}
        if name == "os4":
            left_out.add("battery")
        changes = {
            **{
                f"effects.{e}": table
                for e, table in EFFECTS.items()
                if e not in (*left_out, *given) or e == "rotor_damage"
            },
            **{f"sensors.{e}": table for e, table in SENSORS.items()},
            "autopilot.estimator": "kalman",
            "run.duration": 20.0,
            "trajectory.phase": phases(4.0, 6.0, 0.1),
        }
        self.name, self.battery = name, "battery" not in left_out
        self.scene = load(base, changes)
        self.airframe: Airframe = known_airframe(self.scene)
        self.hover_thrust = motor_failure.build(self.airframe, np.inf, {}).hover_thrust
        self.airspeed = largest_airspeed(self.scene)
        self.gains = self.scene[GainSet]
        if name == OWN:
            model, tick = hover(self.scene), campaign_config(self.scene).interval
            self.gains = gain_set(model, design(model, self.airframe, tick, Bandwidths(), lambda _: None))

    def draw(self, flight: int) -> Draw:
        """Return the values of a flight."""
        random = np.random.default_rng([flight, len(self.name), *self.name.encode()])
        rotors = len(self.airframe.rotor_x)
        factors = [float(np.exp(random.uniform(-x, x))) for x in np.log([1.3, 1.25, 1.2, 1.25])]
        wind, toward = random.uniform(0.05, 0.5) * self.airspeed, random.uniform(-np.pi, np.pi)
        gust, gust_toward = random.uniform(0.0, 0.5) * wind, random.uniform(-np.pi, np.pi)
        course = COURSE * self.airspeed
        arm = max(abs(x) for x in self.airframe.rotor_x)
        shift = 0.02 * arm * self.airframe.mass * self.airframe.gravity
        overrides: dict[str, Any] = {
            "run.seed": flight + 1,
            "effects.wind_constant.velocity": [wind * np.cos(toward), wind * np.sin(toward), 0.0],
            "effects.wind_dryden.wind_speed": wind,
            "effects.wind_dryden.direction_to": toward,
            "effects.wind_gust.peak": [gust * np.cos(gust_toward), gust * np.sin(gust_toward), 0.3 * gust],
            "effects.wind_gust.start": random.uniform(1.0, 8.0),
            "effects.wind_gust.duration": random.uniform(0.3, 2.0),
            "effects.body_wrench.torque": [random.uniform(-shift, shift), random.uniform(-shift, shift), 0.0],
            "trajectory.phase": phases(
                random.uniform(2.0, 6.0), random.uniform(-course, course), random.uniform(0.0, 0.15)
            ),
        }
        charge = random.uniform(0.2, 1.0)
        if self.battery:
            overrides["effects.battery.initial_charge"] = charge
        rotor, moment = int(random.integers(rotors)) + 1, float(random.uniform(FIRST, LAST))
        remaining = (0.0, HALF)[flight // 2 % 2]
        if flight % 2:
            overrides |= {
                "effects.rotor_damage": {
                    "rotor": rotor,
                    "time": moment,
                    "remaining_thrust": remaining,
                    "remaining_torque": remaining,
                },
                "run.duration": moment + AFTER,
            }
        return Draw(Corner(*factors[:3]), factors[3], overrides, rotor if flight % 2 else 0, moment, remaining)

    def config(self, draw: Draw) -> RunConfig:
        """Return the run configuration of a flight."""
        scene = load(self.scene, draw.overrides)
        g, k = self.gains, draw.gains
        scaled = {n: tuple(k * v for v in getattr(g, n)) for n in ("altitude", "yaw", "roll_inner", "pitch_inner")}
        return with_vehicle(with_gains(campaign_config(scene), g.model_copy(update=scaled)), scene, draw.corner)

    def fly(self, flight: int) -> tuple[Draw, Alarm]:
        """Fly. Return the values and the first alarm."""
        draw = self.draw(flight)
        _, diagram = fly_with_ports(self.config(draw), ())
        failed, truth, command = (
            columns(diagram.ports[p].example, diagram.history(p, 1)) for p in (FLIGHT, TRUTH, ACTUATORS)
        )
        at, dt = np.flatnonzero(failed.failed_motor), diagram.config.interval
        first = at[0] if len(at) else len(failed.failed_motor)
        until = min(first, round(draw.moment / dt)) if draw.rotor else first
        q = truth.attitude[:until]
        held = bool(np.all(q[:, 1] ** 2 + q[:, 2] ** 2 < 0.5))  # a tilt below 90 degrees
        if draw.rotor and until < first:
            held &= bool(truth.position_world[until, 2] - self.airframe.resting_height > ALOFT)
            if not len(at):
                held &= bool(command.thrust[until:, draw.rotor - 1].max() > IDLE * self.hover_thrust)
        return draw, Alarm(held, int(failed.failed_motor[first]), first * dt) if len(at) else Alarm(held, 0, np.inf)


def main(
    airframes: Annotated[list[str] | None, typer.Argument(help=f"some of {', '.join(SCENES)}; default: all")] = None,
    flights: Annotated[int, typer.Option(help="flights of each airframe")] = 300,
    first: Annotated[int, typer.Option(help="number of the first flight")] = 0,
) -> list[Row]:
    if unknown := set(airframes or ()) - SCENES.keys():
        raise typer.BadParameter(f"unknown airframe {', '.join(sorted(unknown))}; expected one of {', '.join(SCENES)}")
    totals: Counter[str] = Counter()
    slowest = 0.0
    heads = (
        "m/s",
        "flights",
        "false",
        "lost",
        "found",
        "median",
        "longest",
        "half",
        "found",
        "median",
        "longest",
        "CPU s",
    )
    print(f"{'airframe':15}" + "".join(f"{head:>8}" for head in heads))
    with TemporaryDirectory() as folder:
        for name in airframes or SCENES:
            bench, began, false, crashed = Bench(name, Path(folder)), time.process_time(), 0, 0
            delays: dict[float, list[float]] = {0.0: [], HALF: []}
            for flight in range(first, first + flights):
                draw, alarm = bench.fly(flight)
                if not alarm.held:
                    crashed += 1
                elif draw.rotor and alarm.moment >= draw.moment and alarm.rotor in (0, draw.rotor):
                    delays[draw.remaining].append(alarm.moment - draw.moment)
                elif alarm.rotor:
                    false += 1
                    print(f"{name}: flight {flight}: alarm of rotor {alarm.rotor} at {alarm.moment:.2f} s, {draw}")
            cells = []
            for values in delays.values():
                found = [value for value in values if np.isfinite(value)]
                median, longest = (np.median(found), max(found)) if found else (np.nan, np.nan)
                cells += [f"{len(values):8d}{len(found):8d}{median:8.2f}{longest:8.2f}"]
            counts = f"{bench.airspeed:8.1f}{flights - crashed:8d}{false:8d}"
            print(f"{name:15}{counts}{''.join(cells)}{time.process_time() - began:8.1f}", flush=True)
            lost = delays[0.0]
            totals.update(false=false, lost=len(lost), missed=sum(value == np.inf for value in lost))
            slowest = max([slowest, *(value for value in lost if np.isfinite(value))])
    return show(
        [
            Row("motor failure: false alarms", totals["false"], "", 0.0),
            Row("motor failure: lost rotors not found", totals["missed"], "", 0.0),
            Row("motor failure: longest time to the alarm", slowest, "s", 0.5),
        ]
    )


if __name__ == "__main__":
    command_line(main)
