"""Motion in MAVLink's frames against the decoded message and the conversions of single vectors."""

import random

import pytest

from lapwing.dynamics.geodesy import Home
from lapwing.dynamics.lie.quaternion import Quaternion as Attitude
from lapwing.dynamics.lie.quaternion import to_roll_pitch_yaw
from lapwing.messages import Estimate, Point, Pose, Quaternion, Vector3, VehicleState, header
from lapwing.services.common.mavlink.frames import swap_attitude, swap_body, swap_world
from lapwing.services.common.mavlink.geo_coordinates import enu_to_geodetic, to_local
from lapwing.services.mavlink.vehicle_cache import NedMotion

HOME, STANDING_HEIGHT, TIME_NS = Home(47.4, 8.5, 488.0), 0.25, 12_345_678_901


@pytest.mark.parametrize("kind", [Estimate, VehicleState])
@pytest.mark.parametrize("frame", ["world", "", "a longer frame"])
def test_motion_has_values_of_decoded_message(kind, frame):
    generator = random.Random(f"{kind.__name__} {frame}")
    pose = Pose(Point(*(generator.gauss(0.0, 300.0) for _ in range(3))), Quaternion(0.1, -0.3, 0.5, 0.65**0.5))
    velocity, omega = (Vector3(*(generator.gauss(0.0, 5.0) for _ in range(3))) for _ in range(2))
    message = kind(header(TIME_NS, frame), pose=pose, velocity=velocity, angular_velocity=omega)
    motion = NedMotion(kind, message.encode(), HOME, STANDING_HEIGHT)
    p, q = tuple(pose.position), pose.orientation
    assert motion.time_ns == TIME_NS
    assert motion.position_world == p
    assert motion.position_ned == to_local(STANDING_HEIGHT, p)
    assert motion.velocity_ned == swap_world(tuple(velocity))
    assert motion.omega_frd == swap_body(tuple(omega))
    assert motion.attitude == swap_attitude((q.w, q.x, q.y, q.z))
    assert motion.angles == pytest.approx(to_roll_pitch_yaw(Attitude(*motion.attitude)), abs=1e-12)
    assert motion.geodetic == pytest.approx(enu_to_geodetic(HOME, p), rel=1e-12)
