"""Scripted replacement of PX4 for complete runs: accepts a mission, arms, climbs to 2 m, descends and disarms.

Started as `python scripted_px4.py -i INSTANCE`. With `--silent FILE` it connects, writes its process id, and never
answers; with `--stall` it stops answering in flight; with `--stop` it is halted
there for 3 s. With `--starts FILE` it appends its instance and process id to a file. With `--cores FILE` it writes, in
flight, the cores of its thread and of each thread of its parent process. With `--estimate BIAS` it sends the true state
as its estimate, with a bias of the velocity north [m/s]. With `--received FILE` it writes a line with kind and instance
of each message other than HIL_SENSOR 0. With `--rotors 6` it has the outputs of a hexacopter.
"""

import argparse
import math
import os
import socket
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[3]))

from pymavlink.dialects.v20 import all as mavlink

from tests.services.px4.peer import Px4Peer, instance
from tests.services.stopped import stop_for

HEIGHT = 2.0  # [m]
HOVER = {4: 0.62, 6: 0.55}  # duty in hover, by rotors


class VehicleSide:
    """Vehicle's end of the mission link."""

    def __init__(self, instance):
        """Open the socket."""
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setblocking(False)
        self._to = ("127.0.0.1", 14540 + instance)
        self.codec = mavlink.MAVLink(None, srcSystem=1 + instance, srcComponent=1)
        self.armed, self.count, self.items = False, 0, {}
        self.mode = 0
        self.origin = None

    def estimate(self, truth, bias):
        """Send a HIL_STATE_QUATERNION as the estimate."""
        ms, (vx, vy, vz) = truth.time_usec // 1000, (0.01 * v for v in (truth.vx, truth.vy, truth.vz))
        self.origin = self.origin or (truth.lat, truth.lon, truth.alt)
        north = 1e-7 * (truth.lat - self.origin[0]) * 111.19e3
        east = 1e-7 * (truth.lon - self.origin[1]) * 111.32e3 * math.cos(math.radians(1e-7 * truth.lat))
        down = 1e-3 * (self.origin[2] - truth.alt)
        rates = truth.rollspeed, truth.pitchspeed, truth.yawspeed
        self._send(mavlink.MAVLink_attitude_quaternion_message(ms, *truth.attitude_quaternion, *rates))
        self._send(mavlink.MAVLink_local_position_ned_message(ms, north, east, down, vx + bias, vy, vz))

    def poll(self, beat):
        """Answer the received messages; send a heartbeat if `beat`."""
        if beat:
            self._send(mavlink.MAVLink_heartbeat_message(2, 12, 128 * self.armed | 1, self.mode, 4, 3))
        while True:
            try:
                data = self._socket.recv(4096)
            except OSError:
                return
            for message in self.codec.parse_buffer(data) or ():
                self._handle(message)

    def _send(self, message):
        self._socket.sendto(message.pack(self.codec), self._to)

    def _handle(self, message):
        kind = message.get_type()
        if kind == "MISSION_COUNT":
            self.count, self.items = message.count, {}
            self._send(mavlink.MAVLink_mission_request_int_message(245, 190, 0))
        elif kind == "MISSION_ITEM_INT":
            self.items[message.seq] = message
            if len(self.items) < self.count:
                self._send(mavlink.MAVLink_mission_request_int_message(245, 190, len(self.items)))
            else:
                self._send(mavlink.MAVLink_mission_ack_message(245, 190, 0))
        elif kind == "COMMAND_LONG":
            if message.command == mavlink.MAV_CMD_DO_SET_MODE:
                self.mode = int(message.param2) << 16 | int(message.param3) << 24
            if message.command == mavlink.MAV_CMD_COMPONENT_ARM_DISARM:
                self.armed = True
            self._send(mavlink.MAVLink_command_ack_message(message.command, 0))


def cores_of(status):
    """Return the cores in a `/proc/.../status` file of a thread, such as "0-1"."""
    return status.read_text().partition("Cpus_allowed_list:")[2].split()[0]


def report_cores(file):
    """Write the cores of this thread and of each thread of the parent, its main thread first."""
    parent = os.getppid()
    threads = sorted(Path(f"/proc/{parent}/task").iterdir(), key=lambda path: path.name != str(parent))
    file.write_text(" ".join([cores_of(Path("/proc/self/status")), *(cores_of(path / "status") for path in threads)]))


def main():
    """Run the flight."""
    parser = argparse.ArgumentParser()
    parser.add_argument("-i", type=int)
    parser.add_argument("--silent", type=Path)
    parser.add_argument("--stall", action="store_true")
    parser.add_argument("--stop", action="store_true")
    parser.add_argument("--starts", type=Path)
    parser.add_argument("--cores", type=Path)
    parser.add_argument("--estimate", type=float)
    parser.add_argument("--received", type=Path)
    parser.add_argument("--rotors", type=int, default=4)
    options = parser.parse_args()
    hover = HOVER[options.rotors]
    if options.starts:
        with options.starts.open("a") as file:
            file.write(f"{options.i} {os.getpid()}\n")
    peer, vehicle = Px4Peer(4560 + options.i), VehicleSide(options.i)
    if options.silent:
        options.silent.write_text(str(os.getpid()))
        peer.receive("NEVER")
    message = peer.start()
    ground = height = rate = 0.0
    armed_at, received = None, set()
    while message is not None:
        for other in peer.skipped:
            name = f"{other.get_type()} {instance(other)}"
            if options.received and name not in received:
                received.add(name)
                options.received.write_text("\n".join(sorted(received)))
            if other.get_type() == "HIL_GPS":
                ground = ground or other.alt * 1e-3
                height, rate = other.alt * 1e-3 - ground, -other.vd * 1e-2
            elif other.get_type() == "HIL_STATE_QUATERNION" and options.estimate is not None:
                vehicle.estimate(other, options.estimate)
        peer.skipped.clear()
        time_us = message.time_usec
        vehicle.poll(time_us % 200_000 == 0)
        peer.armed = vehicle.armed
        duty = 0.0
        if vehicle.armed:
            armed_at = armed_at or time_us
            elapsed = (time_us - armed_at) * 1e-6
            target = HEIGHT if elapsed < 5.0 else HEIGHT - 0.5 * (elapsed - 5.0)
            duty = min(max(hover + 0.1 * (target - height) - 0.08 * rate, 0.0), 1.0)
            if elapsed > 12.0:
                vehicle.armed, duty = False, 0.0
                peer.armed = False
            if options.cores and elapsed > 3.0:
                report_cores(options.cores)
                options.cores = None
            if options.stop and elapsed > 3.0:
                options.stop = False
                stop_for(3.0)
            if options.stall and elapsed > 3.0:
                peer.receive("NEVER")
        peer.answer(time_us, (duty,) * options.rotors)
        message = peer.receive()


if __name__ == "__main__":
    main()
