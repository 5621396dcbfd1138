"""A run in one diagram records the same bytes as a run with a diagram for each service.

The diagrams exchange step packets at each tick, as processes do."""

from functools import cache

import pytest
from flights import OPERATED, command, scripted

from lapwing.cosim.diagram.block_diagram import BlockDiagram
from lapwing.cosim.transport.packets import StepPacketCodec, pack_log_packet, unpack_log_packet
from lapwing.services.process_table import CLOCK_OWNER, create_all
from lapwing.services.scene_resolver import load, resolve
from tests.cosim.memory_log import MemoryLog, fly

pytestmark = pytest.mark.long

SENSORS = [
    "autopilot.estimator=kalman", "sensors.imu.preset=mpu6000", "sensors.gps.preset=rtk", "sensors.magnetometer={}",
    "sensors.barometer={}", "sensors.sonar={}",
]  # fmt: skip
FAULTS = [
    'sensors.gps.faults=[{kind="dropout", start=0.5, stop=0.9}]',
    'sensors.imu.faults=[{kind="bias", channel="gyro", start=0.3, size=[0.05, 0.0, 0.0]}]',
    'sensors.barometer.faults=[{kind="freeze", start=0.2}]',
    'sensors.sonar.faults=[{kind="spikes", start=0.1, size=2.0}]',
    'sensors.magnetometer.faults=[{kind="delay", start=0.4, samples=3}]',
]
BATTERY = ["effects.battery.initial_charge=0.16"]
EVENT = 'multibody.event=[{time=0.3, propeller=2, failure="locked"}, {time=0.31, propeller=4, failure="torn_off"}]'
SCRIPT = {0.04: [command("takeoff", 3.0), command("arm")], 0.6: [command("parameter", 5.0, text="PID_Z_P")]}

CASES = {
    "sensors": ("hover", SENSORS, 1.2, None),
    "sensors, another seed": ("hover", [*SENSORS, "run.seed=7"], 0.5, None),
    "sensors that fail": ("hover", [*SENSORS, *FAULTS], 1.2, None),
    "parallel coupling": ("hover", [*SENSORS, "communication.coupling=jacobi"], 0.5, None),
    "a battery runs down": ("hover", BATTERY, 1.0, None),
    "five bodies of which two break": ("delivery_mission", ["vehicle.model=multibody", EVENT], 0.5, None),
    "an operator": ("hover", OPERATED, 1.2, SCRIPT),
    "an operator, on sensors": ("hover", [*SENSORS, *OPERATED], 0.6, SCRIPT),
    "a formation": ("cooperative_load", [], 0.3, None),
    "no autopilot": ("os4_motors", [], 0.3, None),
}


def case(name):
    """Return (run configuration, operator) of a case."""
    scene, overrides, duration, script = CASES[name]
    return resolve(load(scene, [*overrides, f"run.duration={duration}"])), scripted(script) if script else None


@cache
def fly_together(name):
    """Return the flight of a case in one diagram."""
    return fly(*case(name))


def fly_apart(config, operator):
    """Run each service in a separate diagram; its records arrive in log packets of unequal length."""
    services = create_all(config, operator)
    graphs = {service.name: BlockDiagram(config, [service], 64) for service in services}
    bundles = {name: StepPacketCodec(service.ports) for name, service in config.services.items()}
    log, handed = MemoryLog(config), dict.fromkeys(graphs, 0)
    ended = False
    while not ended:
        for name, diagram in graphs.items():
            tick = diagram.tick
            diagram.advance(tick + 1)
            if bundles[name].due(tick):
                payload = bundles[name].pack(diagram, tick)
                for other in graphs.values():
                    if other is not diagram:
                        bundles[name].unpack(payload, other, tick)
        ended = graphs[CLOCK_OWNER].ended
        for i, (name, diagram) in enumerate(graphs.items()):
            if ended or diagram.tick - handed[name] >= 11 + 6 * i:
                batches = diagram.record_batches(handed[name], diagram.tick)
                _, stop, batches = unpack_log_packet(pack_log_packet(batches, handed[name], diagram.tick))
                log.write(batches, stop - 1)
                handed[name] = stop
    return log


@pytest.mark.parametrize("name", CASES)
def test_separate_diagrams_record_same_bytes(name):
    together, apart = fly_together(name), fly_apart(*case(name))
    assert apart.topics.keys() == together.topics.keys()
    for topic in together.topics:
        assert apart.payloads(topic) == together.payloads(topic), topic
    assert apart.digest == together.digest


def test_cases_have_events_of_their_names():
    faults = fly_together("sensors that fail")
    assert any(m.rejected_sources for m in faults.messages("estimate"))
    assert any(m.status.status < 0 for m in faults.messages("gps/fix"))
    charge = fly_together("a battery runs down").column("battery", lambda m: m.percentage)
    assert charge[-1] < charge[0]
    operator = fly_together("an operator")
    assert operator.messages("status")[-1].armed
    assert [len(m.commands) for m in operator.messages("vehicle_command") if m.commands] == [2, 1]
    bodies = fly_together("five bodies of which two break").messages("ground_truth")
    assert bodies[-1].rotor_speed[1] == pytest.approx(0.0, abs=1e-9)
    assert bodies[-1].rotor_speed[3] == bodies[-1].rotor_thrust[3] == 0.0
