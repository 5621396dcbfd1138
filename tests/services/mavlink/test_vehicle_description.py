"""Description of a vehicle from a scene and a log, and import rules of the service."""

import pytest

from lapwing.services.mavlink.resolve import describe, resolve
from lapwing.services.scene_resolver import load


def test_vehicle_of_scene_is_described():
    d = describe(
        load("lapwing/scenes/groundstation.toml", ["vehicle.name=bee", "mavlink.system_id=7", "communication.rate=500"])
    )
    assert (d.name, d.system_id, d.firmware, len(d.rotors), d.tick_ns) == ("bee", 7, "px4", 4, 2_000_000)
    assert d.sensors == ("barometer", "gps", "imu", "magnetometer", "sonar")
    assert (d.battery.cells, d.battery.empty_voltage) == (12, 3.0)
    assert 4.0 < d.battery.charged_voltage < 4.2
    assert d.max_voltage > 0.0
    assert d.accepts_commands
    assert "MIS_TAKEOFF_ALT" in {p.name for p in d.parameters}


def test_missing_parts_are_not_described():
    d = describe(load("lapwing/scenes/hover.toml"))
    assert (d.sensors, d.battery, d.accepts_commands) == ((), None, False)


def test_scene_without_autopilot_has_no_description():
    assert resolve(load("lapwing/scenes/gyrostat_blocked.toml")) is None


def test_unknown_firmware_error_lists_choices():
    from lapwing.services.mavlink import firmware

    with pytest.raises(ValueError, match=r"unknown firmware 'px'; did you mean px4\? \(firmwares: ardupilot, px4\)"):
        firmware.get("px")
