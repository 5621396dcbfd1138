"""Short flights on the true state with scripted commands, without wind."""

import numpy as np

from lapwing.messages import CommandAck, MissionItem, OperatorCommand, Vector3
from lapwing.services.common.failure_types import UNITS
from lapwing.services.scene_resolver import load
from tests.cosim import memory_log

SCENE = "hover"
OPERATED = ["autopilot.accept_commands=true", "autopilot.follow_trajectory=false"]
RATE = 250  # [Hz] of this scene
NAN = float("nan")


def command(kind, *values, text="", items=(), id=0):
    return OperatorCommand(kind, "test", id, tuple(map(float, values)), text, tuple(items))


def item(action, x=NAN, y=NAN, z=NAN, yaw=NAN, radius=NAN, hold=0.0, values=()):
    return MissionItem(action, Vector3(float(x), float(y), float(z)), yaw, radius, hold, tuple(map(float, values)))


def scripted(script):
    """Return an operator for {time [s]: commands}; a key (start, end) repeats the commands at 10 Hz."""

    def operator(tick):
        result = []
        for when, commands in script.items():
            start, end = when if isinstance(when, tuple) else (when, None)
            first = round(start * RATE)
            if end is None:
                result += commands if tick == first else []
            elif first <= tick <= round(end * RATE) and (tick - first) % 25 == 0:
                result += commands
        return result

    return operator


def fly(seconds, script, *overrides, operated=True):
    """Return the recorded flight."""
    sets = [*(OPERATED if operated else []), f"run.duration={seconds}", *overrides]
    return memory_log.fly(load(SCENE, sets), scripted(script))


ENABLED = "autopilot.parameters.SYS_FAILURE_EN=1"


def inject(unit, kind, motor=0, id=7):
    """Return the command of a failure of `lapwing.services.common.failure_types`."""
    return command("inject_failure", UNITS.index(unit), kind, motor, id=id)


UP_BY_SENSORS = {0.04: [command("takeoff", 4.0), command("arm", NAN, 10.0)]}


def fly_by_sensors(seconds, script, *overrides):
    """Fly the scene `groundstation` on sensor readings, with a climb to 4 m in wind. Return the recorded flight."""
    scene = load("groundstation", ["autopilot.follow_trajectory=false", f"run.duration={seconds}", *overrides])
    return memory_log.fly(scene, scripted(UP_BY_SENSORS | script))


def error(flight, start):
    """Return the largest error [m] of the estimated position after the time `start` [s]."""
    estimated, true = (flight.column(t, lambda m: tuple(m.pose.position)) for t in ("estimate", "ground_truth"))
    times, true_times = flight.times("estimate"), flight.times("ground_truth")
    nearest = true[np.searchsorted(true_times, times).clip(0, len(true) - 1)]
    return np.linalg.norm(estimated - nearest, axis=1)[times >= start].max()


def at(flight, topic, t, value):
    """Return `value` of the last message of a topic at or before t [s]."""
    times = flight.times(topic)
    return flight.column(topic, value)[times <= t + 1e-9][-1]


def height(flight, t):
    """Return the true height [m] of the vehicle's origin at t [s]."""
    return at(flight, "ground_truth", t, lambda m: m.pose.position.z)


def place(flight, t):
    """Return the true position [m] at t [s]."""
    return tuple(at(flight, "ground_truth", t, lambda m: tuple(m.pose.position)))


def mode(flight, t):
    """Return the mode at t [s]."""
    return at(flight, "status", t, lambda m: m.mode)


def sent_texts(flight):
    """Return all status texts."""
    return [text for texts in _all(flight, lambda m: m.text) for text in texts]


def results(flight):
    """Return the results of the acknowledgements by id."""
    return {a.id: a.result for answers in _all(flight, lambda m: m.acks) for a in answers}


def _all(flight, value):
    return [value(m) for m in flight.messages("vehicle_command_ack")]


ACCEPTED, REJECTED, DENIED = CommandAck.ACCEPTED, CommandAck.TEMPORARILY_REJECTED, CommandAck.DENIED
UP = {0.04: [command("takeoff", 3.0), command("arm")]}
