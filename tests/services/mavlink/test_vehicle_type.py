import pytest

from lapwing.services.mavlink.px4_facts import px4_facts
from lapwing.services.mavlink.telemetry.system_status import heartbeat
from lapwing.services.mavlink.vehicle_cache import VehicleCache
from lapwing.services.mavlink.vehicle_description import Rotor, VehicleDescription


@pytest.mark.parametrize(("rotors", "kind", "frame"), [(4, 2, 4001), (6, 13, 6001), (8, 14, 8001), (5, 43, 4001)])
def test_heartbeat_and_parameters_agree_on_vehicle_type(rotors, kind, frame):
    """Compare with the numbers of MAVLink's common.xml and PX4's airframe reference."""
    description = VehicleDescription(rotors=(Rotor((0.0, 0.0, 0.0), True),) * rotors)
    facts = {fact.name: fact.value({}) for fact in px4_facts(description)}
    assert heartbeat(VehicleCache(description)).type == facts["MAV_TYPE"] == kind
    assert facts["SYS_AUTOSTART"] == frame
