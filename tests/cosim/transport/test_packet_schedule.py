"""Bundles of several ticks: whatever the services and delays, the lock step comes to its end as with bundles of one."""

from hypothesis import example, given
from hypothesis import strategies as st

from lapwing.cosim.config.run_config import RunConfig, ServiceConfig
from lapwing.cosim.diagram.tick_schedule import InputPort, Port
from lapwing.cosim.run_errors import LockStepError
from lapwing.cosim.transport.packet_schedule import EACH_TICK, PacketSchedule, ticks_at_once, way, ways
from lapwing.services.scene_resolver import load, resolve

LAST = 120  # [tick]
NAMES = ("plant", "sensors", "autopilot", "trajectory", "another")


def setup_of(links):
    """Services that take one another's ports: (producer, consumer): delay [ticks]."""
    services = {
        name: ServiceConfig(
            None, tuple(InputPort(p, d) for (p, c), d in links.items() if c == name and p != name), (Port(name, 0.0),)
        )
        for name in NAMES
    }
    return RunConfig("", "", 1, LAST, 250, 4_000_000, "gauss_seidel", "drone1", services, {}, {})


def newest_needed(setup, producer, consumer, tick):
    """The newest tick of the producer that the consumer takes at `tick`; -1: none."""
    return max(tick - i.delay for i in setup.services[consumer].inputs if i.port == producer)


def end(setup):
    """The ticks that each service has stepped when nobody can go on: as `lapwing.cosim.executors.lockstep` does,
    one after another."""
    stepped = dict.fromkeys(setup.services, 0)
    moved = True
    while moved and min(stepped.values()) <= LAST:
        moved = False
        for name, service in setup.services.items():
            given = {i.port: stepped[i.port] // (n := way(setup, i.port, name).ticks) * n for i in service.inputs}
            ready = stepped[name]
            while ready < stepped[name] + ticks_at_once(setup, name) and all(
                newest_needed(setup, producer, name, ready) < there for producer, there in given.items()
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
def test_it_never_comes_to_a_stop(links):
    setup = setup_of(links)
    try:
        assert setup.order
    except LockStepError:
        return  # a loop without delay is refused
    assert min(end(setup).values()) > LAST


def test_only_who_runs_ahead_hands_over_several_ticks_at_once():
    setup = resolve(load("delivery_mission"))
    assert {name: ticks_at_once(setup, name) for name in setup.services} == {
        "plant": 1, "sensors": 1, "autopilot": 1, "trajectory": 25,
    }  # fmt: skip
    assert ways(setup, "plant") == {EACH_TICK, PacketSchedule(25, 25), PacketSchedule(1, 25)}
    assert ways(setup, "trajectory") == {PacketSchedule(25, 25)}
    assert ways(setup, "sensors") == ways(setup, "autopilot") == {EACH_TICK}


def test_every_way_has_a_key_of_its_own():
    found = [EACH_TICK, PacketSchedule(1, 2), PacketSchedule(1, 25), PacketSchedule(2, 2), PacketSchedule(25, 25)]
    assert EACH_TICK.key == "_step"
    assert len({w.key for w in found}) == len(found)


def test_the_battery_goes_to_the_autopilot_by_itself():
    setup = resolve(load("delivery_mission"))
    taken = way(setup, "plant", "autopilot")
    assert [port.name for port in taken.ports(setup.services["plant"].ports)] == ["battery"]
    assert way(setup, "plant", "sensors") == EACH_TICK
