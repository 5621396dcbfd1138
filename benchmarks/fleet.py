"""Processor time per simulated second over the size of a fleet, in one process and in several.

    python -m benchmarks.fleet [--most VEHICLES]

1, 2, 4, ... equal quadrotors with sensors and all messages in the log. The start-up time is removed: a short
flight is subtracted from a long one.
"""

import tempfile
import time
from pathlib import Path

from benchmarks._command import command_line
from benchmarks._targets import LAPWING, Row, show
from benchmarks.campaign_scaling import measure_command
from lapwing.runs.single_process_run import fly_single
from lapwing.services.scene_resolver import load, resolve

BRIEF, LONG = 1.0, 11.0  # [s]
APART = 3.0  # [m]
ROW = 8  # vehicles in a row
COMMON = """
[run]
duration = 11.0
[effects.gravity]
[effects.air_density]
[effects.rotor_thrust]
[effects.ground_contact]
[sensors.imu]
preset = "mpu6000"
[sensors.magnetometer]
[sensors.gps]
preset = "rtk"
[sensors.barometer]
[sensors.sonar]
preset = "mb1202"
[autopilot]
gains = "quad_x"
[[trajectory.phase]]
name = "climb"
z = { kind = "minimum_jerk", to = 3.0, duration = 4.0 }
[[trajectory.phase]]
name = "hover"
duration = 10.0
"""


def main(most: int = 32) -> list[Row]:
    counts = [2**k for k in range(10) if 2**k <= min(most, 50)]
    with tempfile.TemporaryDirectory() as folder:
        scenes = {n: scene(n, Path(folder, f"fleet_{n}.toml")) for n in counts}
        log = Path(folder, "log.mcap")
        fly_single(resolve(load(scenes[1])), log)  # compiles and loads everything
        single, apart = {}, {}
        for n in counts:
            single[n], apart[n] = (
                per_second(lambda duration, fly=fly, n=n: fly(scenes[n], log, duration))
                for fly in (single_process, multi_process)
            )
            print(f"{n:3} vehicles: {1e3 * single[n]:7.1f} ms/s in one process, {1e3 * apart[n]:7.1f} in multi_process;"
                  f" of each {1e3 * single[n] / n:6.1f} and {1e3 * apart[n] / n:6.1f}", flush=True)  # fmt: skip
    result = [
        Row(f"fleet of {most}, one process: a vehicle to one single_process", single[most] / most / single[1], "", 1.1),
        Row(f"fleet of {most}, multi_process: a vehicle to one single_process", apart[most] / most / apart[1], "", 1.1),
    ]
    return show(result)


def scene(n, path):
    """Write a scene of n vehicles. Return its path."""
    entries = [
        f'[[vehicle]]\nairframe = "quad_x"\ninitial_position = [{APART * (i // ROW)}, {APART * (i % ROW)}]\n'
        for i in range(n)
    ]
    path.write_text(COMMON + "".join(entries))
    return path


def per_second(flight):
    """Return processor time per simulated second; `flight` returns the processor time [s] of a duration [s]."""
    return (flight(LONG) - flight(BRIEF)) / (LONG - BRIEF)


def single_process(path, log, duration):
    """Return the processor time [s] of a flight in this process."""
    config = resolve(load(path, [f"run.duration={duration}"]))
    began = time.process_time()
    fly_single(config, log)
    return time.process_time() - began


def multi_process(path, log, duration):
    """Return the processor time [s] of a command and all its multi_process."""
    fly = [*LAPWING, "run", str(path), "--log", str(log), "--key-prefix", "benchmark-fleet"]
    return measure_command([*fly, "--set", f"run.duration={duration}"])[0]


if __name__ == "__main__":
    command_line(main)
