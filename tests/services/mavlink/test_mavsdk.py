"""MAVSDK, an independent client, flies the fake vehicle through the link."""

import asyncio
import math
import socket

import pytest
from fake_vehicle import PARAMETERS, flying, free_port

mavsdk = pytest.importorskip("mavsdk", reason="mavsdk is not installed: pip install -e .[clients]")
from mavsdk.action import ActionError, OrbitYawBehavior  # noqa: E402
from mavsdk.failure import FailureError, FailureType, FailureUnit  # noqa: E402
from mavsdk.mission import MissionItem, MissionPlan  # noqa: E402
from mavsdk.mission_raw import MissionItem as RawItem  # noqa: E402
from mavsdk.mission_raw import MissionRawError  # noqa: E402
from mavsdk.offboard import (  # noqa: E402
    Attitude,
    OffboardError,
    PositionNedYaw,
    VelocityBodyYawspeed,
    VelocityNedYaw,
)
from mavsdk.param import ParamError  # noqa: E402

pytestmark = pytest.mark.long

END = 60.0  # [s] time-out of a session
SPEED = 2.0  # simulated seconds per second


async def first(stream, condition):
    """Return the first value of a stream that meets a condition."""
    async for value in stream:
        if condition(value):
            return value


async def connected(port):
    drone = mavsdk.System(port=free_port(socket.SOCK_STREAM))
    await drone.connect(system_address=f"udpin://127.0.0.1:{port}")
    await first(drone.core.connection_state(), lambda state: state.is_connected)
    await first(drone.telemetry.health_all_ok(), bool)
    return drone


def session(story, **options):
    """Run `story(drone, vehicle)` with a time-out."""
    port = free_port()

    async def run_story(running):
        drone = await connected(port)
        try:
            await story(drone, running.vehicle)
        finally:
            drone._stop_mavsdk_server()

    with flying(f"udpout:127.0.0.1:{port}", speed=SPEED, **options) as running:
        asyncio.run(asyncio.wait_for(run_story(running), END))
    return running


def test_arm_take_off_go_to_return_land_disarm():
    async def story(drone, vehicle):
        await drone.action.set_takeoff_altitude(4.0)
        assert await drone.action.get_takeoff_altitude() == 4.0
        await drone.action.arm()
        await drone.action.takeoff()
        up = await first(drone.telemetry.position(), lambda p: p.relative_altitude_m > 3.8)
        assert await first(drone.telemetry.in_air(), bool)
        north = up.latitude_deg + 10.0 / 111_000
        await drone.action.goto_location(north, up.longitude_deg, up.absolute_altitude_m + 2.0, 90.0)
        await first(drone.telemetry.position(), lambda p: abs(p.latitude_deg - north) < 5e-6)
        assert vehicle.kinds["goto"].values[3] == pytest.approx(0.0, abs=1e-6)  # east
        await drone.action.hold()
        await first(drone.telemetry.flight_mode(), lambda mode: str(mode) == "HOLD")
        await drone.action.return_to_launch()
        await first(drone.telemetry.armed(), lambda armed: not armed)
        await drone.action.arm()
        await drone.action.takeoff()
        await first(drone.telemetry.in_air(), bool)
        await drone.action.land()
        await first(drone.telemetry.landed_state(), lambda state: str(state) == "ON_GROUND")
        await first(drone.telemetry.armed(), lambda armed: not armed)

    assert session(story).vehicle.kinds["link"].source.startswith("245/")


def test_rejected_command_has_reason():
    async def story(drone, vehicle):
        vehicle.arming_blockers = ("no GPS fix",)
        await first(drone.telemetry.health(), lambda health: not health.is_armable)
        reported = asyncio.ensure_future(first(drone.telemetry.status_text(), lambda s: "no GPS fix" in s.text))
        await asyncio.sleep(0.3)
        with pytest.raises(ActionError, match="DENIED"):
            await drone.action.arm()
        assert "cannot arm" in (await reported).text
        with pytest.raises(ActionError):
            await drone.action.takeoff()
        assert not vehicle.armed

    session(story)


def test_missions_go_up_and_down_are_flown_paused_and_cleared():
    def item(north, up):
        return MissionItem(
            40.7686 + north / 111_000, 14.7907, up, 5.0, True, math.nan, math.nan, MissionItem.CameraAction.NONE,
            math.nan, math.nan, math.nan, math.nan, math.nan, MissionItem.VehicleAction.NONE,
        )  # fmt: skip

    async def story(drone, vehicle):
        plan = MissionPlan([item(5.0, 5.0), item(25.0, 8.0), item(0.0, 3.0)])
        await drone.mission.upload_mission(plan)
        down = await drone.mission.download_mission()
        assert [(i.latitude_deg, i.relative_altitude_m) for i in down.mission_items] == [
            (pytest.approx(i.latitude_deg, abs=1e-7), i.relative_altitude_m) for i in plan.mission_items
        ]
        assert {i.action for i in vehicle.items} <= {"waypoint", "speed", "delay"}
        await drone.action.arm()
        await drone.mission.start_mission()
        await first(drone.mission.mission_progress(), lambda p: p.current >= 1)
        await drone.mission.pause_mission()
        await first(drone.telemetry.flight_mode(), lambda mode: str(mode) == "HOLD")
        await drone.mission.start_mission()
        await first(drone.mission.mission_progress(), lambda p: p.current == p.total == 3)
        assert await drone.mission.is_mission_finished()
        await drone.mission.clear_mission()
        assert vehicle.items == ()
        fence = RawItem(0, 3, 5003, 0, 1, 50.0, 0.0, 0.0, 0.0, 407686000, 147907000, 0.0, 1)
        await drone.mission_raw.upload_geofence([fence])
        assert vehicle.fences[0].action == "fence_circle_in"
        await drone.mission_raw.upload_rally_points(
            [RawItem(0, 3, 5100, 0, 1, *(0.0,) * 4, 407687000, 147907000, 5.0, 2)]
        )
        assert vehicle.rally[0].position.y == pytest.approx(11.1, abs=0.1)
        with pytest.raises(MissionRawError):
            await drone.mission_raw.upload_mission([RawItem(0, 3, 18, 1, 1, *(0.0,) * 4, 407687000, 147907000, 5.0, 0)])

    session(story)


def test_offboard_flight_by_position_velocity_and_attitude():
    async def story(drone, vehicle):
        await drone.action.arm()
        with pytest.raises(OffboardError):
            await drone.offboard.start()
        await drone.offboard.set_position_ned(PositionNedYaw(3.0, 2.0, -4.0, 90.0))
        while vehicle.setpoint is None:
            await asyncio.sleep(0.02)
        await drone.offboard.start()
        await first(
            drone.telemetry.position_velocity_ned(),
            lambda o: math.dist((o.position.north_m, o.position.east_m, o.position.down_m), (3.0, 2.0, -4.0)) < 0.1,
        )
        assert vehicle.setpoint[9] == pytest.approx(0.0, abs=1e-6)
        await drone.offboard.set_velocity_ned(VelocityNedYaw(0.0, 1.0, -1.0, 0.0))
        await first(  # not only climbing: the previous leg ended in a climb too
            drone.telemetry.position_velocity_ned(),
            lambda o: abs(o.velocity.north_m_s) < 0.1 and abs(o.velocity.down_m_s + 1.0) < 0.1,
        )
        assert vehicle.velocity == pytest.approx((1.0, 0.0, 1.0))
        await drone.offboard.set_velocity_body(VelocityBodyYawspeed(2.0, 0.0, 0.0, 10.0))  # the nose points east
        await first(drone.telemetry.position_velocity_ned(), lambda o: o.velocity.east_m_s > 1.5)
        assert vehicle.setpoint[10] == pytest.approx(-math.radians(10.0))
        await drone.offboard.set_attitude(Attitude(10.0, 0.0, 90.0, 0.6))
        while "offboard_attitude" not in vehicle.kinds:
            await asyncio.sleep(0.02)
        assert vehicle.setpoint[:2] == pytest.approx(
            (math.cos(math.radians(5.0)), math.sin(math.radians(5.0))), abs=1e-6
        )
        assert vehicle.setpoint[7] == pytest.approx(0.6)
        await drone.offboard.stop()
        await first(drone.telemetry.flight_mode(), lambda mode: str(mode) == "HOLD")

    session(story)


def test_parameters_rates_and_sticks():
    async def story(drone, vehicle):
        assert await drone.param.get_param_float("MPC_XY_P") == pytest.approx(0.95)
        await drone.param.set_param_float("MPC_XY_P", 1.25)
        assert vehicle.parameters["MPC_XY_P"] == 1.25
        await drone.param.set_param_int("NAV_DLL_ACT", 3)
        assert await drone.param.get_param_int("NAV_DLL_ACT") == 3
        with pytest.raises(ParamError):
            await drone.param.get_param_float("NO_SUCH")
        everything = await drone.param.get_all_params()
        names = {p.name for p in (*everything.float_params, *everything.int_params)}
        assert names > {p.name for p in PARAMETERS}
        assert {p.name: p.value for p in everything.int_params}["SYS_AUTOSTART"] == 4001

        await drone.telemetry.set_rate_position(2.0)
        stamps = []
        async for _ in drone.telemetry.position():
            stamps.append(vehicle.seconds)
            if len(stamps) == 5:
                break
        assert (stamps[-1] - stamps[1]) / 3.0 == pytest.approx(0.5, abs=0.25)  # simulated seconds

        await drone.action.arm()
        for _ in range(5):
            await drone.manual_control.set_manual_control_input(0.5, 0.0, 0.75, 0.0)
            await asyncio.sleep(0.05)
        await drone.manual_control.start_position_control()
        while vehicle.position[0] < 0.3:
            await drone.manual_control.set_manual_control_input(0.5, 0.0, 0.75, 0.0)
            await asyncio.sleep(0.02)
        assert vehicle.mode == "position_control"
        assert vehicle.stick == pytest.approx((0.5, 0.0, 0.5, 0.0))

    session(story)


def test_orbit_failures_and_log(tmp_path):
    path = tmp_path / "flight.mcap"
    path.write_bytes(bytes(range(250)) * 200)

    async def story(drone, vehicle):
        vehicle.do_inject_failure = lambda c: 0
        await drone.action.arm()
        await drone.action.do_orbit(5.0, 2.0, OrbitYawBehavior.HOLD_FRONT_TO_CIRCLE_CENTER, 40.7687, 14.7907, 290.0)
        assert vehicle.kinds["orbit"].values[3:5] == pytest.approx((5.0, -2.0))
        await drone.failure.inject(FailureUnit.SYSTEM_MOTOR, FailureType.OFF, 2)
        assert vehicle.kinds["inject_failure"].values[:3] == (7.0, 1.0, 2.0)
        with pytest.raises(FailureError):
            await drone.failure.inject(FailureUnit.SENSOR_VIO, FailureType.OFF, 0)
        (entry,) = await drone.log_files.get_entries()
        assert entry.size_bytes == path.stat().st_size
        copy = tmp_path / "copy.mcap"
        async for progress in drone.log_files.download_log_file(entry, str(copy)):
            if progress.progress >= 1.0:
                break
        assert copy.read_bytes() == path.read_bytes()

    session(story, log=path)


def test_events_and_arming_checks_are_read():
    async def story(drone, vehicle):
        vehicle.arming_blockers = ("the vehicle is not level",)
        report = await first(drone.events.health_and_arming_checks(), lambda report: report.all_problems)
        assert [problem.message for problem in report.all_problems] == ["The vehicle is not level"]
        assert not report.current_mode_intention.can_arm_or_run
        assert {"gyro", "gps", "battery", "attitude_estimate"} <= {c.name for c in report.health_components}
        vehicle.arming_blockers = ()
        await first(drone.events.health_and_arming_checks(), lambda r: r.current_mode_intention.can_arm_or_run)
        reported = []

        async def listen():
            async for event in drone.events.events():
                reported.append(event)

        listening = asyncio.ensure_future(listen())
        await asyncio.sleep(0.3)
        await drone.action.arm()
        await drone.action.takeoff()
        await first(drone.telemetry.in_air(), bool)
        vehicle.status = {"failsafe": True, "text": "the battery is critical"}
        while not any(event.event_name == "failsafe" for event in reported):
            await asyncio.sleep(0.02)
        listening.cancel()
        texts = [event.message for event in reported]
        assert [text for text in texts if text in ("Armed", "Takeoff detected")] == ["Armed", "Takeoff detected"]
        failsafe = next(event for event in reported if event.event_name == "failsafe")
        assert failsafe.message.startswith("Failsafe: the battery is critical, now ")
        assert (failsafe.event_namespace, str(failsafe.log_level)) == ("lapwing", "CRITICAL")

    session(story)
