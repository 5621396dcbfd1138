"""Scripted replacement of ArduPilot for complete runs: climbs to 2 m, descends and stops the motors.

Started as `python scripted_ardupilot.py --instance N ...`. It opens its first MAVLink port as ArduPilot does, and ends
if it cannot. With `--die` it exits in flight, with `--stop` it is stopped there for 3 s. With `--slow-exit S` it keeps
its port for S seconds after SIGTERM. With `--starts FILE` it appends its instance and process id to a file. It writes a
dataflash log as text, `logs/00000001.BIN`. With `--yaw D` outputs that differ by D turn the vehicle from 3 s
to 4 s. With `--estimate BIAS` it sends the state as its estimate by MAVLink, with a bias of the velocity north [m/s].
With `--rotors 6` it has the outputs of a hexacopter.
"""

import argparse
import math
import os
import signal
import socket
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[3]))

from pymavlink.dialects.v20 import all as mavlink

from tests.services.ardupilot.peer import ArduPilotPeer
from tests.services.stopped import stop_for

HEIGHT = 2.0  # [m]
HOVER = {4: 0.62, 6: 0.55}  # duty in hover, by rotors
SPINS = {4: (-1, -1, 1, 1), 6: (1, -1, 1, -1, -1, 1)}  # torque of each output: 1 if its propeller turns clockwise

FORMATS = (
    "FMT, 128, 89, FMT, BBnNZ, Type,Length,Name,Format,Columns",
    "FMT, 65, 50, IMU, QBffffff, TimeUS,I,GyrX,GyrY,GyrZ,AccX,AccY,AccZ",
    "FMT, 66, 50, XKF1, QBffffff, TimeUS,C,VN,VE,VD,PN,PE,PD",
    "FMT, 67, 50, XKQ, QBffff, TimeUS,C,Q1,Q2,Q3,Q4",
    "FMT, 68, 50, RCOU, QHHHHHH, TimeUS,C1,C2,C3,C4,C5,C6",
    "FMT, 69, 50, BAT, QBff, TimeUS,Inst,Volt,Curr",
)


def log_lines(state, pulses):
    """Return the lines of the log with a state and the outputs [us] that follow it."""
    us = round(state["timestamp"][0] * 1e6)
    fields = {
        "IMU": (0, *state["gyro"], *state["accel_body"]),
        "XKF1": (0, *state["velocity"], *state["position"]),
        "XKQ": (0, *state["quaternion"]),
        "RCOU": (*pulses, *(0,) * (6 - len(pulses))),
        "BAT": (0, *state["battery"]),
    }
    return [", ".join(map(str, (name, us, *values))) for name, values in fields.items()]


def estimate(state, bias):
    """Return a heartbeat and the estimate."""
    ms, (vx, vy, vz) = round(1e3 * state["timestamp"][0]), state["velocity"]
    return [
        mavlink.MAVLink_heartbeat_message(2, 3, 1, 0, 4, 3),
        mavlink.MAVLink_attitude_quaternion_message(ms, *state["quaternion"], *state["gyro"]),
        mavlink.MAVLink_local_position_ned_message(ms, *state["position"], vx + bias, vy, vz),
    ]


def main():
    """Run the flight."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--instance", type=int)
    parser.add_argument("--die", action="store_true")
    parser.add_argument("--stop", action="store_true")
    parser.add_argument("--slow-exit", type=float, default=0.0)
    parser.add_argument("--starts", type=Path)
    parser.add_argument("--yaw", type=float, default=0.0)
    parser.add_argument("--estimate", type=float)
    parser.add_argument("--rotors", type=int, default=4)
    options, _ = parser.parse_known_args()
    hover, spins = HOVER[options.rotors], SPINS[options.rotors]
    if options.starts:
        with options.starts.open("a") as file:
            file.write(f"{options.instance} {os.getpid()}\n")

    def end(*_):
        time.sleep(options.slow_exit)
        sys.exit()

    signal.signal(signal.SIGTERM, end)
    port = 5760 + 10 * options.instance
    try:
        server = socket.create_server(("127.0.0.1", port))
    except OSError:
        sys.exit(f"bind failed on port {port} - Address already in use")
    Path("logs").mkdir(exist_ok=True)
    log = Path("logs/00000001.BIN").open("w", buffering=1)  # noqa: SIM115 (open until the program is killed)
    log.writelines(f"{line}\n" for line in FORMATS)
    peer, pulses, ground = ArduPilotPeer(9002 + 10 * options.instance), [1000] * options.rotors, None
    with server:
        client, codec = None, mavlink.MAVLink(None, srcSystem=1, srcComponent=1)
        if options.estimate is not None:
            client, _ = server.accept()
        while True:
            state = peer.exchange((*pulses, *(0,) * (16 - len(pulses))))
            ground = -state["position"][2] if ground is None else ground
            height, rate, elapsed = -state["position"][2] - ground, -state["velocity"][2], state["timestamp"][0] - 1.001
            target = HEIGHT if elapsed < 5.0 else HEIGHT - 0.5 * (elapsed - 5.0)
            duty = min(max(hover + 0.1 * (target - height) - 0.08 * rate, 0.0), 1.0) if 0.0 < elapsed < 12.0 else 0.0
            turn = math.copysign(options.yaw, 3.5 - elapsed) if 3.0 < elapsed < 4.0 else 0.0  # left, then stop
            pulses = [1000 + round(1000 * (duty + sign * turn)) for sign in spins]
            if peer.count % 10 == 0:
                log.writelines(f"{line}\n" for line in log_lines(state, pulses))
            if client and peer.count % 20 == 0:
                client.sendall(b"".join(message.pack(codec) for message in estimate(state, options.estimate)))
            if options.stop and elapsed > 2.0:
                options.stop = False
                stop_for(3.0)
            if options.die and elapsed > 3.0:
                sys.exit("crashed on purpose")


if __name__ == "__main__":
    main()
