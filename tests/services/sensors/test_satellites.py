"""Constellations, shadows, multipath and RTK of a receiver against closed forms and independent implementations."""

import math

import numpy as np
import pytest
from scipy.optimize import brentq

from lapwing.dynamics.config_error import ConfigError
from lapwing.dynamics.environment import STANDARD
from lapwing.dynamics.geodesy import geodetic_to_enu
from lapwing.dynamics.noise import stream_key
from lapwing.dynamics.terrain import LEVEL, relief
from lapwing.dynamics.vector import ZERO
from lapwing.flights.flight_data import FlightData
from lapwing.services.common.ports import GPS_FLOAT, GPS_RTK, GPS_SINGLE, GpsReading
from lapwing.services.sensors import encoders, gps, multipath, satellites, schema
from lapwing.services.sensors.multipath import CHIP, WAVELENGTH, Reflections
from lapwing.services.sensors.rtk import Gap, Rtk
from lapwing.services.sensors.satellites import Constellation
from lapwing.services.sensors.sensor_inputs import Truth
from tests.commands import run_command

pytestmark = pytest.mark.usefixtures("uncompiled")

KEY, HOME = stream_key(7, "drone1", "gps"), STANDARD.home
GALILEO = Constellation()


def truth(position=ZERO, terrain=LEVEL):
    return Truth(position, height_above_ground=2.0, environment=STANDARD._replace(gravity=9.81, terrain=terrain))


def readings(p, samples, at=None, terrain=LEVEL, key=KEY):
    """Return the readings of a receiver at rest, or at the position of each sample."""
    s, result = gps.initial(p, key, truth(ZERO if at is None else at(0), terrain)), []
    for tick in range(samples):
        s, r = gps.sample(p, s, key, tick, truth(ZERO if at is None else at(tick), terrain))
        result.append(r)
    return result


def places(result):
    return np.array([geodetic_to_enu(HOME, r.latitude_deg, r.longitude_deg, r.height) for r in result])


def look_angles(c, time):
    """Return the unit vectors of all satellites by rotation matrices, independent of the kernel."""

    def about(axis, angle):
        i, j = ((1, 2), (2, 0), (0, 1))[axis]
        R = np.eye(3)
        R[i, i] = R[j, j] = np.cos(angle)
        R[i, j], R[j, i] = -np.sin(angle), np.sin(angle)
        return R

    radius, result = 6378137.0 + c.altitude, []
    rate = 2.0 * np.pi / (2.0 * np.pi * np.sqrt(radius**3 / 3.986004418e14))
    latitude, longitude = np.radians((HOME.latitude_deg, HOME.longitude_deg))
    e2 = 1.0 - (1.0 - 1.0 / 298.257223563) ** 2
    n = 6378137.0 / np.sqrt(1.0 - e2 * np.sin(latitude) ** 2)
    up = np.array([np.cos(latitude) * np.cos(longitude), np.cos(latitude) * np.sin(longitude), np.sin(latitude)])
    here = (n + HOME.height) * up - [0.0, 0.0, n * e2 * np.sin(latitude)]
    east = np.array([-np.sin(longitude), np.cos(longitude), 0.0])
    for k in range(c.satellites):
        plane, slot = divmod(k, c.satellites // c.planes)
        u = np.radians(360.0 * slot * c.planes / c.satellites + 360.0 * c.phasing * plane / c.satellites) + rate * time
        orbit = about(2, np.radians(360.0 * plane / c.planes)) @ about(0, np.radians(c.inclination_deg))
        place = about(2, -7.292115e-5 * time) @ orbit @ [radius * np.cos(u), radius * np.sin(u), 0.0] - here
        place /= np.linalg.norm(place)
        result.append((place @ east, place @ np.cross(up, east), place @ up))
    return np.array(result)


@pytest.mark.parametrize("time", [0.0, 5000.0, -40000.0])
def test_directions_are_those_of_rotated_orbits(time):
    mine = np.array([satellites.direction(GALILEO, HOME, k, time) for k in range(24)])
    np.testing.assert_allclose(mine, look_angles(GALILEO, time), atol=1e-9)


def test_constellation_repeats_after_10_days():
    """Galileo's ground track repeats after 17 revolutions in 10 sidereal days, within the drift of its real orbits."""
    day = 2.0 * math.pi / satellites.EARTH_RATE
    first = np.array([satellites.direction(GALILEO, HOME, k, 0.0) for k in range(24)])
    again = np.array([satellites.direction(GALILEO, HOME, k, 10.0 * day) for k in range(24)])
    assert np.degrees(np.arccos(np.clip((first * again).sum(axis=1), -1.0, 1.0))).max() < 1.0


def test_dilution_over_a_day_is_that_of_full_constellation():
    """At least 6 satellites, PDOP below 6: the bound that the GPS and Galileo performance standards use."""
    p = gps.Gps(constellation=GALILEO._replace(mask_deg=5.0), rate=1.0 / 600.0)
    result = readings(p, 144)
    pdop = np.array([math.hypot(r.hdop, r.vdop) for r in result])
    assert min(r.used for r in result) >= 6
    assert pdop.max() < 6.0
    assert len(np.unique(np.round(pdop, 3))) > 100  # varies
    directions = [look_angles(GALILEO, 600.0 * k) for k in (0, 50, 100)]
    for k, d in zip((0, 50, 100), directions, strict=True):
        visible = d[d[:, 2] > math.sin(math.radians(5.0))]
        rows = np.column_stack([visible, np.ones(len(visible))])
        expected = np.diag(np.linalg.inv(rows.T @ rows))
        assert result[k].used == result[k].visible == len(visible)
        assert result[k].hdop == pytest.approx(math.sqrt(expected[0] + expected[1]), rel=1e-6)
        assert result[k].vdop == pytest.approx(math.sqrt(expected[2]), rel=1e-6)


@pytest.mark.long
def test_errors_are_least_squares_of_range_errors():
    """The mean square error over receivers is the stated variance, sigma^2 (A^T A)^-1."""
    p = gps.Gps(constellation=GALILEO, range_correlated_error=3.0, range_noise_m_per_sqrt_hz=1.0)
    errors, last = [], None
    for seed in range(1500):
        last = readings(p, 1, key=stream_key(seed, "drone1", "gps"))[0]
        errors.append(places([last])[0])
    expected = np.array(last.position_variance)
    assert expected.sum() == pytest.approx((9.0 + 5.0) * (last.hdop**2 + last.vdop**2))
    np.testing.assert_allclose(np.square(errors).mean(axis=0), expected, rtol=0.15)


@pytest.mark.parametrize("preset", ["rtk", "standard"])
def test_constellation_keeps_horizontal_error_of_preset(preset):
    """Root mean square over a day, within 10 %."""
    p = gps.PRESETS[preset]
    result = readings(p._replace(constellation=GALILEO, latency_samples=0, rate=1.0 / 600.0), 144)
    variance = np.mean([r.hdop**2 for r in result]) * np.square((p.range_correlated_error, p.range_noise_m_per_sqrt_hz))
    stated = np.square((p.correlated_error_horizontal, p.noise_horizontal_m_per_sqrt_hz))
    assert np.sqrt(0.5 * variance) == pytest.approx(np.sqrt(stated), rel=0.1)


def test_position_jumps_when_visible_satellites_change():
    """The jump is the difference of the two least-squares solutions; between jumps the errors change continuously."""
    p = gps.Gps(constellation=GALILEO, range_correlated_error=3.0, correlation_time=1e9, rate=0.1)
    result = readings(p, 1000)
    steps = np.linalg.norm(np.diff(places(result), axis=0), axis=1)
    changes = np.diff([r.used for r in result]) != 0
    assert changes.any()
    assert steps[changes].max() > 0.5
    assert steps[~changes].max() < 0.05


def test_building_hides_satellites_behind_it():
    """North of a wide, high box only satellites above its edge or in the northern half are visible."""
    block = relief(boxes=[(0.0, -60.0, 400.0, 100.0, 0.0, 60.0)])
    at = (0.0, 0.0, 1.0)
    p = gps.Gps(constellation=GALILEO)
    free, [r] = readings(p, 1)[0], readings(p, 1, lambda _: at, block)
    d = look_angles(GALILEO, 0.0)
    d = d[d[:, 2] > math.sin(math.radians(10.0))]
    hidden = np.array([u < 0 and 10.0 * w / -u < 59.0 for _, u, w in d])
    assert hidden.sum() > 0
    assert (r.visible, r.used) == (free.visible, len(d) - hidden.sum())
    assert r.hdop > free.hdop


def test_detour_is_path_of_image_antenna():
    """Box wall at x = 10: the antenna's image is at x = 20 - x; the path is longer by (image - antenna) . u."""
    wall = np.array([15.0, 0.0, 1.0, 0.0, -5.0, 5.0, 30.0, 40.0])
    antenna, towards = np.array([4.0, 3.0, 1.5]), np.array([-0.6, 0.2, math.sqrt(1 - 0.4)])
    image = antenna * [-1, 1, 1] + [20.0, 0.0, 0.0]
    expected = (antenna - image) @ towards
    assert multipath.detour(wall, tuple(antenna), tuple(towards), False) == pytest.approx(expected)
    assert multipath.detour(wall, tuple(antenna), (0.6, 0.2, towards[2]), False) == 0.0  # from behind the wall
    rotated_box = np.array([0.0, 15.0, 0.0, 1.0, -5.0, 5.0, 30.0, 40.0])  # the same wall across y
    a, u = (-3.0, 4.0, 1.5), (-0.2, -0.6, towards[2])
    assert multipath.detour(rotated_box, a, u, False) == pytest.approx(expected)
    low = np.array([*wall[:7], 8.0])  # above its top
    assert multipath.detour(low, tuple(antenna), tuple(towards), False) == 0.0


@pytest.mark.parametrize("further", [2.0, 12.3, 40.0, 150.0, 290.0, 305.0, 400.0])
@pytest.mark.parametrize("phase", [0.0, 180.0, 70.0])
def test_code_error_is_zero_of_early_minus_late(further, phase):
    """Against the numerical zero of a coherent early-minus-late discriminator with triangular correlations."""
    r = Reflections(0.4, 0.2 * CHIP, phase)
    q = 0.4 * math.cos(2.0 * math.pi * further / WAVELENGTH + math.radians(phase))

    def correlation(x):
        return max(0.0, 1.0 - abs(x) / CHIP) + q * max(0.0, 1.0 - abs(x - further) / CHIP)

    zero = brentq(lambda x: correlation(x + 0.1 * CHIP) - correlation(x - 0.1 * CHIP), -0.1 * CHIP, 0.1 * CHIP)
    assert multipath.code_delay(r, further) == pytest.approx(zero, abs=1e-6)


@pytest.mark.parametrize("further", [0.5, 3.21, 40.07])
def test_carrier_error_is_phase_of_phasor_sum(further):
    r = Reflections(0.7, 0.1 * CHIP, 180.0)
    phasor = 1.0 + 0.7 * np.exp(1j * (2.0 * np.pi * further / WAVELENGTH + np.pi))
    assert multipath.phase_delay(r, further) == pytest.approx(np.angle(phasor) / (2.0 * np.pi) * WAVELENGTH)
    assert abs(multipath.phase_delay(r, further)) < 0.25 * WAVELENGTH


def test_long_range_of_satellite_overhead_lowers_fix():
    """The sign: a delay on the highest satellite moves the fix down, on a low one away from it."""
    c = GALILEO._replace(mask_deg=5.0)
    d = look_angles(c, 0.0)
    for k in (int(np.argmax(d[:, 2])), int(np.argmin(np.where(d[:, 2] > 0.1, d[:, 2], 9.0)))):
        errors = np.zeros((8, 3))
        errors[k // 3, k % 3] = 1.0
        range_errors = tuple((float(x), float(y), float(z)) for x, y, z in errors)
        fix = satellites.solution(c, HOME, LEVEL, ZERO, 0.0, range_errors, 1.0, 0.0, False, KEY, 0)
        visible = d[d[:, 2] > math.sin(math.radians(5.0))]
        rows = np.column_stack([-visible, np.ones(len(visible))])
        expected = np.linalg.lstsq(rows, (visible == d[k]).all(axis=1).astype(float), rcond=None)[0][:3]
        np.testing.assert_allclose(fix.error, expected, atol=1e-9)
        assert np.dot(fix.error, d[k]) < 0.0


def test_multipath_moves_fix_near_walls_only():
    street = relief(boxes=[(0.0, 14.0, 80.0, 8.0, 0.0, 20.0)])
    clean = gps.Gps(constellation=GALILEO)
    at = (0.0, 0.0, 1.0)
    for status, least, most in ((0, 0.2, 30.0), (2, 1e-4, 0.5)):  # code and carrier
        p = clean._replace(fix_status=status, constellation=GALILEO._replace(reflections=Reflections()))
        near, far = readings(p, 1, lambda _: at, street)[0], readings(p, 1, lambda _: (500.0, 0.0, 1.0), street)[0]
        assert least < np.linalg.norm(places([near])[0] - at) < most
        np.testing.assert_allclose(places([far])[0], (500.0, 0.0, 1.0), atol=1e-6)


def test_time_to_first_fix_is_stated_value():
    result = readings(gps.Gps(time_to_first_fix=2.6, rate=10.0), 40)
    assert [r.valid for r in result] == [k >= 26 for k in range(40)]


def test_rtk_solution_converges_and_falls_back():
    """Fixed; single when corrections are older than 2 s; float for 3 s, then fixed; errors in the stated ratios."""
    rtk = Rtk(20.0, 100.0, 3.0, 5, 2.0, (Gap(1.0, 5.0),))
    p = gps.Gps(correlated_error_horizontal=0.01, correlated_error_vertical=0.015, correlation_time=1e9, rtk=rtk)
    result = readings(p, 100)
    kinds = np.array([r.fix for r in result])
    expected = np.where(np.arange(100) < 31, GPS_RTK, np.where(np.arange(100) < 51, GPS_SINGLE, GPS_FLOAT))
    expected[80:] = GPS_RTK
    np.testing.assert_array_equal(np.abs(kinds - expected)[[10, 28, 34, 48, 54, 76, 84, 99]], 0)
    assert np.flatnonzero(np.diff(kinds)) == pytest.approx([30, 50, 80], abs=1)
    sizes = np.linalg.norm(places(result), axis=1)
    assert sizes[40] / sizes[0] == pytest.approx(100.0, rel=1e-3)
    assert sizes[60] / sizes[0] == pytest.approx(20.0, rel=1e-3)
    assert math.sqrt(result[60].position_variance[2]) == pytest.approx(20.0 * 0.015)
    assert all(r.valid for r in result)


def test_rtk_is_float_with_few_satellites():
    p = gps.Gps(constellation=GALILEO, rtk=Rtk(satellites_min=24), fix_status=2)
    assert {r.fix for r in readings(p, 5)[1:]} == {GPS_FLOAT}


def test_messages_contain_kind_of_fix_and_dilution():
    columns = [
        GpsReading(40.0, 14.0, 300.0, (0.04, 0.09, 0.25), (3.0, 4.0, -1.0), 0.01, 0.1, True, kind, 9, 11, 0.9, 1.2)
        for kind in (GPS_SINGLE, GPS_FLOAT, GPS_RTK)
    ]
    columns.append(columns[0]._replace(valid=False))
    rows = GpsReading(*(np.array(part) for part in zip(*columns, strict=True)))
    times = np.arange(4) * 10**9
    details, fix = encoders._gps_details(rows, times), encoders._gps(0, rows, times)
    np.testing.assert_array_equal(details["status.status"], (0, 20, 19, -1))  # of gps_msgs/GPSStatus
    np.testing.assert_array_equal(fix["status.status"], (0, 2, 2, -1))
    assert details["track"][0] == pytest.approx(math.degrees(math.atan2(3.0, 4.0)))
    assert (details["speed"][0], details["climb"][0], details["pdop"][0]) == pytest.approx((5.0, -1.0, 1.5))


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ({"constellation": {"planes": 5}}, r"gps.constellation.planes: expected a divisor of satellites = 24, got 5"),
        (
            {"rtk": {"corrections_lost": [{"start": 4.0, "stop": 3.0}]}},
            "gps.rtk.corrections_lost.0.stop: expected late",
        ),
        ({"constellation": {"reflections": {"amplitude": 1.0}}}, "gps.constellation.reflections.amplitude: expected"),
    ],
)
def test_wrong_options_are_rejected(table, message):
    with pytest.raises(ConfigError, match=message):
        schema.parameters("gps", table, 0.004)


def test_constellation_excludes_sky():
    sky = [{"azimuth_deg": a, "elevation_deg": e} for a, e in ((0.0, 45.0), (120.0, 45.0), (240.0, 45.0), (60.0, 90.0))]
    with pytest.raises(ConfigError, match=r"gps.constellation: cannot be combined with sky; expected one of them"):
        schema.parameters("gps", {"sky": sky, "constellation": {}}, 0.004)


@pytest.mark.long
def test_command_records_details(tmp_path):
    values = [
        "run.duration=4.0", "success.require=[]", "sensors.gps.constellation={time=1000.0}",
        "sensors.gps.rtk={corrections_lost=[{start=1.0}],age_max=1.0}", "sensors.gps.time_to_first_fix=0.5",
    ]  # fmt: skip
    log = tmp_path / "a.mcap"
    sets = [part for text in values for part in ("--set", text)]
    command = ["run", "quad_x", *sets, "--mode", "single-process", "--log", log]
    run_command(*command, code=0)
    details = FlightData.read(log).topic("gps/details")
    status = details["status.status"]
    assert (status[0], status[6], status[-1]) == (-1, 20, 0)
    assert details["hdop"].min() > 0.3
    bad = run_command(*command, "--set", "sensors.gps.constellation={planes=7}", code=2)
    assert "sensors.gps.constellation.planes: expected a divisor" in bad.stderr
