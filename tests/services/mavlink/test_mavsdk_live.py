"""MAVSDK, an independent client, flies the complete vehicle: plant, sensors, estimator, autopilot, link.

Missions, parameters and sticks are in `test_mavsdk.py`, on a fake vehicle.

The run is faster than real time; whatever the client waits for is bounded by END.
"""

import asyncio
import math
import signal
import socket
import subprocess
import sys

import pytest
from fake_vehicle import free_port

mavsdk = pytest.importorskip("mavsdk", reason="mavsdk is not installed: pip install -e .[clients]")
from mavsdk.action import ActionError  # noqa: E402
from mavsdk.offboard import (  # noqa: E402
    Attitude,
    OffboardError,
    PositionNedYaw,
    VelocityNedYaw,
)

from lapwing.cosim.log import LogReader  # noqa: E402
from lapwing.runs.resimulate import resimulate  # noqa: E402

pytestmark = pytest.mark.long

SCENE = "lapwing/scenes/groundstation.toml"
END = 150.0  # [s] wall-clock time-out of a session
SPEED = 3.0  # simulated seconds per second


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


def session(tmp_path, key_prefix, story, *sets):
    """Run `story(drone)` on a live run. Return its log."""
    port, log = free_port(), tmp_path / f"{key_prefix}.mcap"
    command = [sys.executable, "-m", "lapwing", "run", SCENE, "--key-prefix", key_prefix, "--log", str(log)]
    command += ["--mavlink", f"udpout:127.0.0.1:{port}", "--speed", f"{SPEED:g}"]
    command += [part for each in ("run.duration=900", *sets) for part in ("--set", each)]

    async def run_story():
        drone = await started(f"udpin://127.0.0.1:{port}")
        try:
            await first(drone.core.connection_state(), lambda state: state.is_connected, 120.0)
            await first(drone.telemetry.health_all_ok(), bool)
            await story(drone)
        finally:
            drone._stop_mavsdk_server()

    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True) as process:
        try:
            asyncio.run(asyncio.wait_for(run_story(), END))
        except BaseException:
            process.send_signal(signal.SIGTERM)
            print(process.communicate(timeout=60)[0])
            raise
        process.send_signal(signal.SIGTERM)
        process.communicate(timeout=60)
    return log


async def started_offboard(drone):
    """Enter offboard mode after the first setpoints."""
    while True:
        try:
            return await drone.offboard.start()
        except OffboardError:
            await asyncio.sleep(0.2)


def near(position, place):
    """Return True if the vehicle is at its target (latitude, longitude, height)."""
    north, east = (position.latitude_deg - place[0]) * 111_049, (position.longitude_deg - place[1]) * 84_418
    return math.hypot(north, east) < 0.5 and abs(position.relative_altitude_m - place[2]) < 0.5


@pytest.mark.nightly
def test_flight_with_return_and_resimulation_of_log(tmp_path):
    async def story(drone):
        health = await first(drone.telemetry.health(), lambda h: h.is_armable)
        assert health.is_global_position_ok
        assert health.is_home_position_ok
        with pytest.raises(ActionError):  # not armed
            await drone.action.return_to_launch()
        battery = await first(drone.telemetry.battery(), lambda b: b.voltage_v > 0.0)
        assert battery.remaining_percent == pytest.approx(100.0, abs=1.0)
        await drone.action.set_takeoff_altitude(4.0)
        assert await drone.action.get_takeoff_altitude() == 4.0
        await drone.action.arm()
        await drone.action.takeoff()
        up = await first(drone.telemetry.position(), lambda p: p.relative_altitude_m > 3.8)
        assert await first(drone.telemetry.in_air(), bool)
        there = up.latitude_deg + 10.0 / 111_049, up.longitude_deg, up.relative_altitude_m + 2.0
        await drone.action.goto_location(*there[:2], up.absolute_altitude_m + 2.0, 90.0)
        await first(drone.telemetry.position(), lambda p: near(p, there))
        await first(drone.telemetry.heading(), lambda h: abs(h.heading_deg - 90.0) < 3.0)
        await drone.action.hold()
        await first(drone.telemetry.flight_mode(), lambda mode: str(mode) == "HOLD")
        await drone.action.return_to_launch()
        await first(drone.telemetry.flight_mode(), lambda mode: str(mode) == "RETURN_TO_LAUNCH")
        await first(drone.telemetry.armed(), lambda armed: not armed)
        home = await first(drone.telemetry.home(), lambda _: True)
        assert near(
            await first(drone.telemetry.position(), lambda _: True), (home.latitude_deg, home.longitude_deg, 0.0)
        )
        await drone.action.arm()
        await drone.action.takeoff()
        await first(drone.telemetry.in_air(), bool)
        await drone.action.land()
        await first(drone.telemetry.landed_state(), lambda state: str(state) == "ON_GROUND")
        await first(drone.telemetry.armed(), lambda armed: not armed)

    log = session(tmp_path, "test-mavsdk-go", story, "autopilot.parameters.RTL_RETURN_ALT=6.0")
    with LogReader(log) as read:
        assert read.complete
    before, again = resimulate(log)
    assert before == again


def test_offboard_by_position_velocity_and_attitude(tmp_path):
    async def story(drone):
        state = drone.telemetry.position_velocity_ned
        await drone.action.arm()
        with pytest.raises(OffboardError):  # no setpoints arrive
            await drone.offboard.start()
        await drone.offboard.set_position_ned(PositionNedYaw(3.0, 2.0, -4.0, 90.0))
        await started_offboard(drone)
        place = 3.0, 2.0, -4.0
        await first(
            state(), lambda o: math.dist((o.position.north_m, o.position.east_m, o.position.down_m), place) < 0.4
        )
        await drone.offboard.set_velocity_ned(VelocityNedYaw(0.0, 2.0, -1.0, 90.0))
        await first(state(), lambda o: o.velocity.east_m_s > 1.7 and o.velocity.down_m_s < -0.8)
        await drone.offboard.set_attitude(Attitude(0.0, -8.0, 90.0, 0.36))
        await first(drone.telemetry.attitude_euler(), lambda a: a.pitch_deg < -5.0)
        await drone.offboard.set_velocity_ned(VelocityNedYaw(0.0, 0.0, 0.0, 90.0))
        await first(state(), lambda o: math.hypot(o.velocity.north_m_s, o.velocity.east_m_s, o.velocity.down_m_s) < 0.3)
        await drone.offboard.stop()
        await first(drone.telemetry.flight_mode(), lambda mode: str(mode) == "HOLD")
        await drone.action.land()
        await first(drone.telemetry.armed(), lambda armed: not armed)

    # MAVSDK may pause for longer on a busy machine
    session(tmp_path, "test-mavsdk-offboard", story, "autopilot.parameters.COM_OF_LOSS_T=60")
