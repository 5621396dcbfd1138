"""Description of a vehicle from a scene, and its type."""

import pytest

from lapwing.services.mavlink.px4_facts import px4_facts
from lapwing.services.mavlink.resolve import describe, resolve
from lapwing.services.mavlink.telemetry.system_status import heartbeat
from lapwing.services.mavlink.vehicle_cache import VehicleCache
from lapwing.services.mavlink.vehicle_description import Rotor, VehicleDescription
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


@pytest.mark.parametrize(("rotors", "kind", "frame"), [(4, 2, 4001), (6, 13, 6001), (8, 14, 8001), (5, 43, 4001)])
def test_heartbeat_and_parameters_agree_on_vehicle_type(rotors, kind, frame):
    """Compare with the numbers of MAVLink's common.xml and PX4's airframe reference."""
    description = VehicleDescription(rotors=(Rotor((0.0, 0.0, 0.0), True),) * rotors)
    facts = {fact.name: fact.value({}) for fact in px4_facts(description)}
    assert heartbeat(VehicleCache(description)).type == facts["MAV_TYPE"] == kind
    assert facts["SYS_AUTOSTART"] == frame
