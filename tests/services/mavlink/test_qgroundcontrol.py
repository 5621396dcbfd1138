"""Messages of QGroundControl's buttons to a flying vehicle.

The messages are those of its PX4 plug-in (PX4FirmwarePlugin.cc, Vehicle.cc). The table in docs/reference/mavlink.md
lists the buttons; `QGroundControl` has a method for each.
"""

import math
from pathlib import Path

import pytest
from adapter_harness import Station, item
from autopilot_harness import AutopilotBench

from lapwing.services.common.mavlink.dialect import mavlink
from lapwing.services.mavlink.firmware import px4

pytestmark = pytest.mark.long

NAN = math.nan
MODES = {mode.name: mode.number for mode in px4.MODES}
CHANGE_MODE = 1.0  # MAV_DO_REPOSITION_FLAGS
UNCHANGED = 5.0  # ORBIT_YAW_BEHAVIOUR
NORTH, EAST = 111_013.0, 84_420.0  # [m] of a degree at home


class QGroundControl(Station):
    """Buttons of QGroundControl: each sends its messages and returns the displayed result."""

    def step(self):
        if self.bench.diagram.tick % 250 < 10:
            self.send("heartbeat", 6, 8, 0, 0, 0, 3)

    def newest(self, kind):
        self.bench.until(lambda: self.last(kind))
        return self.last(kind)

    @property
    def altitude(self):
        """Displayed altitude above sea level [m]."""
        return self.newest("GLOBAL_POSITION_INT").alt * 1e-3

    @property
    def place(self):
        m = self.newest("GLOBAL_POSITION_INT")
        return m.lat * 1e-7, m.lon * 1e-7

    @property
    def mode(self):
        return self.newest("HEARTBEAT").custom_mode

    @property
    def armed(self):
        return bool(self.newest("HEARTBEAT").base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED)

    def at(self, command, *params, frame=mavlink.MAV_FRAME_GLOBAL):
        """Send a command with a position as COMMAND_INT, which the vehicle supports."""
        *four, latitude, longitude, altitude = params
        self.got.clear()
        place = round(latitude * 1e7), round(longitude * 1e7), altitude
        self.send("command_int", 1, 1, frame, command, 0, 0, *four, *place)
        return self.newest("COMMAND_ACK").result

    def set_mode(self, name):
        """Set a mode without acknowledgement: QGroundControl waits until the heartbeat shows it."""
        self.send("set_mode", 1, mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED, MODES[name])
        self.got.clear()
        return 0 if self.bench.until(lambda: self.last("HEARTBEAT") and self.mode == MODES[name], 1.5) else None

    def arm(self):
        return self.command(400, 1.0)

    def disarm(self):
        return self.command(400, 0.0)

    def takeoff(self, above=10.0):
        result = self.command(22, -1.0, 0.0, 0.0, NAN, NAN, NAN, self.altitude + above)
        return result or self.arm()

    def land(self):
        return self.set_mode("Land")

    def return_(self):
        return self.set_mode("Return")

    def pause(self):
        return self.command(192, -1.0, CHANGE_MODE, 0.0, NAN, NAN, NAN, NAN)

    def go_to(self, latitude, longitude):
        return self.at(192, -1.0, CHANGE_MODE, 0.0, NAN, latitude, longitude, self.altitude)

    def change_altitude(self, by):
        above_home = self.newest("GLOBAL_POSITION_INT").relative_alt * 1e-3
        home = self.newest("HOME_POSITION").altitude * 1e-3
        return self.pause() or self.command(192, -1.0, CHANGE_MODE, 0.0, NAN, NAN, NAN, home + above_home + by)

    def change_heading(self, heading):
        return self.command(192, -1.0, CHANGE_MODE, 0.0, heading, NAN, NAN, NAN)

    def change_speed(self, speed):
        return self.command(178, 1.0, speed, -1.0, 0.0, NAN, NAN, NAN)

    def orbit(self, latitude, longitude, radius):
        return self.at(34, radius, NAN, UNCHANGED, NAN, latitude, longitude, self.altitude)

    def roi(self, latitude, longitude, ground):
        return self.at(195, NAN, NAN, NAN, NAN, latitude, longitude, ground)

    def cancel_roi(self):
        return self.command(197)

    def set_home(self, latitude, longitude, ground):
        return self.command(179, 0.0, 0.0, 0.0, NAN, latitude, longitude, ground)

    def start_mission(self):
        return self.set_mode("Mission") or self.arm()

    def continue_mission(self):
        return self.start_mission()

    def set_waypoint(self, number):
        self.send("mission_set_current", 1, 1, number)
        return 0 if self.bench.until(lambda: self.newest("MISSION_CURRENT").seq == number, 2.0) else None

    def emergency_stop(self):
        return self.command(400, 0.0, 21196.0)

    def gripper(self, action):
        return self.command(211, 0.0, float(action))

    def virtual_joystick(self, x=0, y=0, z=500, r=0):
        self.send("manual_control", 1, x, y, z, r, 0)


ACCEPTED = mavlink.MAV_RESULT_ACCEPTED


@pytest.fixture
def station():
    flight = AutopilotBench()
    flight.step(25)
    return flight.station_of(QGroundControl)


def test_buttons_of_flight_without_mission(station):
    fly, until, start = station.bench, station.bench.until, station.place

    def above():
        return station.newest("GLOBAL_POSITION_INT").relative_alt * 1e-3

    def heading():
        return math.degrees(station.newest("ATTITUDE").yaw)

    def bearing_of(place):
        """Return the bearing [deg] of a position, clockwise from north."""
        latitude, longitude = station.place
        return math.degrees(math.atan2((place[1] - longitude) * EAST, (place[0] - latitude) * NORTH))

    assert station.set_mode("Hold") == 0  # as in older versions before a take-off
    assert station.takeoff(6.0) == ACCEPTED
    assert until(lambda: station.mode == MODES["Hold"] and above() > 5.5, 20.0)
    assert above() == pytest.approx(6.0, abs=0.2)
    assert station.change_altitude(2.0) == ACCEPTED
    assert until(lambda: abs(above() - 8.0) < 0.1)
    assert station.change_heading(math.radians(-90.0)) == ACCEPTED
    assert until(lambda: abs(heading() + 90.0) < 2.0)
    assert station.change_speed(3.0) == ACCEPTED
    assert station.go_to(start[0] + 60.0 / NORTH, start[1]) == ACCEPTED
    fly.step(100)
    assert station.newest("LOCAL_POSITION_NED").vx == pytest.approx(3.0, abs=0.1)
    assert station.pause() == ACCEPTED
    fly.step(100)
    assert abs(station.newest("LOCAL_POSITION_NED").vx) < 0.1
    assert station.roi(start[0], start[1], station.altitude - above()) == ACCEPTED
    assert until(lambda: abs(abs(heading()) - 180.0) < 5.0)  # home is in the south
    assert station.cancel_roi() == ACCEPTED
    centre = station.place[0], station.place[1] + 8.0 / EAST
    assert station.orbit(*centre, 8.0) == ACCEPTED
    assert until(lambda: abs(station.newest("LOCAL_POSITION_NED").vx) > 0.5)
    assert until(lambda: abs(heading() - bearing_of(centre)) < 15.0)  # the nose to the centre
    assert station.set_home(start[0] + 20.0 / NORTH, start[1], station.altitude - above()) == ACCEPTED
    fly.step(75)
    assert station.newest("HOME_POSITION").latitude * 1e-7 == pytest.approx(start[0] + 20.0 / NORTH, abs=1e-6)
    assert station.return_() == 0
    assert until(lambda: not station.armed, 90.0)
    assert (station.place[0] - start[0]) * NORTH == pytest.approx(20.0, abs=0.5)


def test_buttons_of_mission_and_emergency_stop(station):
    until = station.bench.until
    for seq, (command, north) in enumerate(((22, 0.0), (16, 15.0), (16, 30.0), (20, 0.0))):
        if not seq:
            station.send("mission_count", 1, 1, 4, 0)
        assert until(lambda seq=seq: any(m.seq == seq for m in station.all("MISSION_REQUEST_INT")))
        station.send("mission_item_int", *item(seq, command=command, north=north))
    assert until(lambda: station.last("MISSION_ACK"))
    assert station.last("MISSION_ACK").type == 0
    assert station.start_mission() == ACCEPTED
    assert until(lambda: station.newest("MISSION_CURRENT").seq == 1, 20.0)
    assert station.pause() == ACCEPTED
    assert until(lambda: station.mode == MODES["Hold"])
    assert station.set_waypoint(2) == 0
    assert station.continue_mission() == ACCEPTED
    assert until(lambda: station.newest("LOCAL_POSITION_NED").x > 20.0, 20.0)
    assert station.land() == 0
    assert until(lambda: station.newest("LOCAL_POSITION_NED").vz > 0.3)
    for _ in range(100):
        station.virtual_joystick(z=500)
        station.bench.step(3)
        if station.set_mode("Position") == 0:
            break
    else:
        pytest.fail("the sticks do not take over")
    assert station.emergency_stop() == ACCEPTED
    assert until(lambda: not station.armed, 2.0)


def test_arming_and_gripper(station):
    assert station.gripper(mavlink.GRIPPER_ACTION_RELEASE) == mavlink.MAV_RESULT_UNSUPPORTED  # no payload
    assert station.arm() == ACCEPTED
    assert station.disarm() == ACCEPTED
    assert not station.armed


def test_table_in_documentation_has_these_buttons():
    text = Path("docs/reference/mavlink.md").read_text()
    table = text[text.index("| button ") :].split("\n\n")[0]
    buttons = [name.strip() for row in table.splitlines()[2:] for name in row.split("|")[1].split(",")]
    output = {name.lower().replace(" ", "_") for name in buttons if not name.startswith("shown where")}
    tried = {name.rstrip("_") for name in vars(QGroundControl) if not name.startswith("_")}
    helpers = {"step", "newest", "altitude", "place", "mode", "armed", "at", "set_mode"}
    assert output - {"log_download"} == tried - helpers  # which test_mavsdk.py tries
