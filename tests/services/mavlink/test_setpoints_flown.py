"""Setpoints of both firmwares, flown by the autopilot according to mask and frame."""

import math

import pytest
from adapter_harness import Station
from autopilot_harness import AutopilotBench

pytestmark = pytest.mark.long

NAN = math.nan
VELOCITY, POSITION, BOTH, ACCELERATION = 0xDC7, 0xDF8, 0xDC0, 0xC3F  # type masks without yaw
YAW, YAW_RATE = 0x9FF, 0x5FF
FAR = 0.35  # [m]


class Client(Station):
    """Station that streams setpoints at 12.5 Hz."""

    def stream(self, seconds, send):
        self.got.clear()
        for k in range(round(seconds / self.bench.period)):
            if k % 2 == 0:
                send()
            if k == 3 and self.px4:
                self.send("set_mode", 1, 1, 6 << 16)
            if k % 25 == 0:
                self.send("heartbeat", 6, 8, 0, 0, 0, 3)
            self.bench.step()
        m = self.last("LOCAL_POSITION_NED")
        return (m.x, m.y, m.z), (m.vx, m.vy, m.vz), math.degrees(self.last("ATTITUDE").yaw)

    def local(self, seconds, frame, mask, *values):
        fields = [*values, *[0.0] * (11 - len(values))]
        return self.stream(seconds, lambda: self.send("set_position_target_local_ned", 0, 1, 1, frame, mask, *fields))

    def world(self, seconds, frame, altitude):
        place = 407686000, 147907000, altitude
        fields = [*place, *[0.0] * 8]
        return self.stream(
            seconds, lambda: self.send("set_position_target_global_int", 0, 1, 1, frame, POSITION, *fields)
        )


@pytest.mark.parametrize("firmware", ["px4", "ardupilot"])
def test_mavlink_setpoints_are_flown(firmware):
    bench = AutopilotBench("hover", f"mavlink.firmware={firmware}")
    station = bench.station_of(Client)
    station.px4 = firmware == "px4"
    bench.step(10)
    assert station.last("LOCAL_POSITION_NED").z == pytest.approx(0.0, abs=0.02)  # start position
    above = station.last("GLOBAL_POSITION_INT").alt * 1e-3 if station.px4 else 0.0
    assert station.command(176, 1.0, 4.0, 3.0) == station.command(400, 1.0) == 0
    assert station.command(22, -1.0, 0.0, 0.0, NAN, NAN, NAN, above + 5.0) == 0
    bench.step(125)
    assert station.last("LOCAL_POSITION_NED").z == pytest.approx(-5.0, abs=0.1)

    _, v, _ = station.local(2.5, 1, VELOCITY, 0, 0, 0, 1.0)
    assert v == pytest.approx((1.0, 0.0, 0.0), abs=0.05)  # north
    _, _, yaw = station.local(8.0, 1, YAW, *[0.0] * 9, -math.pi / 2)
    assert yaw == pytest.approx(-90.0, abs=2.0)
    _, v, _ = station.local(2.5, 8, VELOCITY, 0, 0, 0, 1.0)
    assert v == pytest.approx((0.0, -1.0, 0.0), abs=0.05)  # forward is west
    _, _, yaw = station.local(3.0, 1, YAW_RATE, *[0.0] * 10, 0.3)
    assert yaw == pytest.approx(-90.0 + math.degrees(0.3 * 3.0), abs=8.0)
    _, v, _ = station.local(2.5, 1, ACCELERATION, *[0.0] * 7, 0.5)
    assert v[1] > 0.5  # east
    at, _, _ = station.local(8.0, 1, POSITION, 0.0, 0.0, -6.0)
    assert math.dist(at, (0.0, 0.0, -6.0)) < FAR
    assert station.last("GLOBAL_POSITION_INT").relative_alt * 1e-3 == pytest.approx(6.0, abs=0.1)
    at, _, _ = station.world(6.0, 6, 8.0)
    assert math.dist(at, (0.0, 0.0, -8.0)) < FAR
    at, _, _ = station.world(6.0, 5, 280.35 + 6.0)
    assert math.dist(at, (0.0, 0.0, -6.0)) < FAR
    _, v, _ = station.local(0.8, 1, BOTH, 0.0, 0.0, -6.0, 0.5)
    assert 0.0 < v[0] < 0.5  # the velocity leads away from the position setpoint
    _, v, _ = station.local(1.0, 7, POSITION, 3.0, 0.0, 0.0)
    assert v[0] > 0.5  # repeatedly 3 m north of the current position
