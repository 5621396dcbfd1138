"""MAVSDK flies the complete vehicle, alone and with everything at once.

Two ground stations, MAVSDK offboard, a log download and FTP metadata share a mission. Nothing may time out: MAVSDK
raises its own time-outs, and no station may miss heartbeats for three simulated seconds.
"""

import asyncio
import json
import math
import signal
import socket
import subprocess
import sys
import threading

import pytest
from fake_vehicle import free_port
from pymavlink import mavutil

from lapwing.services.mavlink.component_metadata import GENERAL

pytest.importorskip("mavsdk", reason="mavsdk is not installed: pip install -e .[clients]")
import mavsdk
from mavsdk.mission import MissionItem, MissionPlan
from mavsdk.offboard import OffboardError, PositionNedYaw

pytestmark = pytest.mark.long

SCENE = "lapwing/scenes/groundstation.toml"
SILENT = 3000  # [ms] of simulation time without heartbeat after which a ground station reports a lost link
END = 900.0  # [s] of wall time after which the test has failed


async def first(stream, condition, seconds=60.0):
    """Return the first value of a stream that meets a condition."""

    async def wait():
        async for value in stream:
            if condition(value):
                return value

    return await asyncio.wait_for(wait(), seconds)


async def started(url):
    """Return a listening MAVSDK; its server may not start on a busy machine, and is then restarted."""
    for seconds in (60.0, 240.0):
        drone = mavsdk.System(port=free_port(socket.SOCK_STREAM))
        try:
            await asyncio.wait_for(drone.connect(system_address=url), seconds)
            return drone
        except TimeoutError:
            drone._stop_mavsdk_server()
    raise AssertionError("MAVSDK's server does not start")


async def started_offboard(drone):
    """Enter offboard mode after the first setpoints."""
    while True:
        try:
            return await drone.offboard.start()
        except OffboardError:
            await asyncio.sleep(0.2)


class Station:
    """Ground station on a separate link: sends heartbeats and requests all parameters repeatedly."""

    def __init__(self):
        self.port = free_port()
        self.link = mavutil.mavlink_connection(f"udpin:127.0.0.1:{self.port}", source_system=255)
        self.gaps, self.lists, self.names = [], 0, set()
        self._seen, self._ended = None, threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def close(self):
        self._ended.set()
        self._thread.join()
        self.link.close()

    def _run(self):
        now, requested = 0, None
        while not self._ended.is_set():
            message = self.link.recv_match(blocking=True, timeout=0.2)
            if message is None:
                continue
            kind = message.get_type()
            if kind == "ATTITUDE":
                now = message.time_boot_ms
                if requested is None or now - requested > 5000:
                    requested = now
                    self.link.mav.heartbeat_send(6, 8, 0, 0, 4)
                    self.link.mav.param_request_list_send(1, 1)
            elif kind == "HEARTBEAT" and message.get_srcSystem() == 1:
                if self._seen is not None:
                    self.gaps.append(now - self._seen)
                self._seen = now
            elif kind == "PARAM_VALUE":
                self.names.add(message.param_id)
                if len(self.names) == message.param_count:
                    self.lists += 1
                    self.names = set()


def item(north, up):
    return MissionItem(
        40.7686 + north / 111_049, 14.7907, up, 2.0, True, math.nan, math.nan, MissionItem.CameraAction.NONE,
        math.nan, math.nan, math.nan, math.nan, math.nan, MissionItem.VehicleAction.NONE,
    )  # fmt: skip


async def download(stream):
    """Wait for the end of a download."""
    async for _ in stream:
        pass


async def story(drone, log, folder):
    """Fly a mission; meanwhile download the log and the metadata; fly offboard; finish the mission."""
    plan = [item(10.0 * (k % 2), 4.0 + k) for k in range(6)]
    await drone.mission.upload_mission(MissionPlan(plan))
    await drone.action.arm()
    await drone.mission.start_mission()
    await first(drone.mission.mission_progress(), lambda p: p.current >= 1, END)

    (entry,) = await drone.log_files.get_entries()
    copy = folder / "copy.mcap"
    jobs = [download(drone.log_files.download_log_file(entry, str(copy)))]
    jobs.append(download(drone.ftp.download(GENERAL, str(folder), False)))
    jobs.append(drone.param.get_all_params())
    *_, parameters = await asyncio.gather(*jobs)
    assert copy.stat().st_size == entry.size_bytes
    assert log.read_bytes().startswith(copy.read_bytes()[:1024])
    assert json.loads((folder / GENERAL.rpartition("/")[2]).read_text())["metadataTypes"]
    assert len(parameters.float_params) + len(parameters.int_params) > 100

    await drone.offboard.set_position_ned(PositionNedYaw(3.0, 2.0, -6.0, 0.0))
    await started_offboard(drone)
    place = 3.0, 2.0, -6.0
    await first(
        drone.telemetry.position_velocity_ned(),
        lambda o: math.dist((o.position.north_m, o.position.east_m, o.position.down_m), place) < 0.5,
        END,
    )
    await drone.mission.start_mission()
    await first(drone.mission.mission_progress(), lambda p: p.current == p.total == len(plan), END)
    await drone.action.land()
    await first(drone.telemetry.armed(), lambda armed: not armed, END)


@pytest.mark.parametrize("speed", [pytest.param(1, marks=pytest.mark.nightly), 5])
def test_stations_offboard_log_and_metadata_share_mission(tmp_path, speed):
    port, log, stations = free_port(), tmp_path / "flight.mcap", [Station(), Station()]
    command = [sys.executable, "-m", "lapwing", "run", SCENE, "--key-prefix", f"test-all-{speed}", "--log", str(log)]
    for each in (port, *(station.port for station in stations)):
        command += ["--mavlink", f"udpout:127.0.0.1:{each}"]
    command += ["--speed", str(speed), "--set", "run.duration=3600", "--set", "autopilot.parameters.COM_OF_LOSS_T=60"]

    async def tell():
        drone = await started(f"udpin://127.0.0.1:{port}")
        try:
            await first(drone.core.connection_state(), lambda state: state.is_connected, END)
            await first(drone.telemetry.health_all_ok(), bool, END)
            await story(drone, log, tmp_path)
        finally:
            drone._stop_mavsdk_server()

    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True) as process:
        try:
            asyncio.run(asyncio.wait_for(tell(), END))
        finally:
            process.send_signal(signal.SIGTERM)
            output = process.communicate(timeout=120)[0]
            print(output)
            for station in stations:
                station.close()
    for station in stations:
        assert station.lists >= 1
        assert len(station.gaps) > 20
        assert max(station.gaps) < SILENT


def test_example_of_guide_flies(tmp_path):
    port = free_port()
    command = [sys.executable, "-m", "lapwing", "run", SCENE, "--key-prefix", "example", "--speed", "3"]
    command += ["--mavlink", f"udpout:127.0.0.1:{port}", "--log", str(tmp_path / "example.mcap")]
    script = [sys.executable, "examples/mavsdk_flight.py", f"udpin://127.0.0.1:{port}"]
    with subprocess.Popen(command, stdout=subprocess.DEVNULL) as process:
        try:
            done = subprocess.run(script, stdout=subprocess.PIPE, text=True, timeout=END, check=True)
        finally:
            process.send_signal(signal.SIGTERM)
    assert done.stdout.splitlines()[1:] == ["10 m north", "landed and disarmed"]
