"""Step packets of several ticks: lock step reaches the end of the run for all services and delays."""

from hypothesis import example, given
from hypothesis import strategies as st

from lapwing.cosim.config.run_config import RunConfig, ServiceConfig
from lapwing.cosim.diagram.tick_schedule import InputPort, Port
from lapwing.cosim.run_errors import LockStepError
from lapwing.cosim.transport.packets import (
    EACH_TICK,
    PacketSchedule,
    packet_schedule,
    packet_schedules,
    ticks_per_packet,
)
from lapwing.services.scene_resolver import load, resolve

LAST = 120  # [tick]
NAMES = ("plant", "sensors", "autopilot", "trajectory", "another")


def config_of(links):
    """Return services with these connections: (producer, consumer): delay [ticks]."""
    services = {
        name: ServiceConfig(
            None, tuple(InputPort(p, d) for (p, c), d in links.items() if c == name and p != name), (Port(name, 0.0),)
        )
        for name in NAMES
    }
    return RunConfig("", "", 1, LAST, 250, 4_000_000, "gauss_seidel", "drone1", services, {}, {})


def newest_needed(config, producer, consumer, tick):
    """Return the newest tick of the producer that the consumer reads at `tick`; negative: none."""
    return max(tick - i.delay for i in config.services[consumer].inputs if i.port == producer)


def end(config):
    """Return the ticks of each service when none can continue, in the order of `lapwing.cosim.executors.lockstep`."""
    stepped = dict.fromkeys(config.services, 0)
    moved = True
    while moved and min(stepped.values()) <= LAST:
        moved = False
        for name, service in config.services.items():
            values = {
                i.port: stepped[i.port] // (n := packet_schedule(config, i.port, name).ticks) * n
                for i in service.inputs
            }
            ready = stepped[name]
            while ready < stepped[name] + ticks_per_packet(config, name) and all(
                newest_needed(config, producer, name, ready) < there for producer, there in values.items()
            ):
                ready += 1
            ready = min(ready, LAST + 50)
            moved = moved or ready > stepped[name]
            stepped[name] = ready
    return stepped


pairs = st.tuples(st.sampled_from(NAMES), st.sampled_from(NAMES)).filter(lambda pair: pair[0] != pair[1])


@given(st.dictionaries(pairs, st.integers(0, 30), max_size=12))
@example(
    {("plant", "autopilot"): 0, ("autopilot", "plant"): 1, ("trajectory", "autopilot"): 0, ("plant", "trajectory"): 9}
)
@example({("plant", "trajectory"): 2, ("trajectory", "plant"): 0})
@example({("plant", "trajectory"): 9, ("trajectory", "another"): 9, ("another", "plant"): 0})
@example({("plant", "trajectory"): 25, ("trajectory", "another"): 3, ("another", "plant"): 1})
def test_packet_schedule_cannot_deadlock(links):
    config = config_of(links)
    try:
        assert config.order
    except LockStepError:
        return  # algebraic loops are rejected
    assert min(end(config).values()) > LAST


def test_only_leading_service_packs_several_ticks():
    config = resolve(load("delivery_mission"))
    assert {name: ticks_per_packet(config, name) for name in config.services} == {
        "plant": 1, "sensors": 1, "autopilot": 1, "trajectory": 25,
    }  # fmt: skip
    assert packet_schedules(config, "plant") == {EACH_TICK, PacketSchedule(25, 25), PacketSchedule(1, 25)}
    assert packet_schedules(config, "trajectory") == {PacketSchedule(25, 25)}
    assert packet_schedules(config, "sensors") == packet_schedules(config, "autopilot") == {EACH_TICK}


def test_packet_schedules_have_unique_keys():
    result = [EACH_TICK, PacketSchedule(1, 2), PacketSchedule(1, 25), PacketSchedule(2, 2), PacketSchedule(25, 25)]
    assert EACH_TICK.key == "_step"
    assert len({w.key for w in result}) == len(result)


def test_battery_has_separate_packets():
    config = resolve(load("delivery_mission"))
    schedule = packet_schedule(config, "plant", "autopilot")
    assert [port.name for port in schedule.ports(config.services["plant"].ports)] == ["battery"]
    assert packet_schedule(config, "plant", "sensors") == EACH_TICK
