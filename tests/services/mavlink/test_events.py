"""MAVLink's Events Interface: events are sent as numbers, in order and without gaps; the metadata defines their text.

The reader is an independent implementation of libevents' README and receiver."""

import json
import re
import struct

import pytest
from adapter_harness import Bench

from lapwing.messages import Actuators, VehicleState
from lapwing.messages.topics import ACTUATORS, TRUTH
from lapwing.services.autopilot.commander.failsafes import FAILSAFES
from lapwing.services.autopilot.commander.mode_table import MODES
from lapwing.services.autopilot.estimator import NAMES
from lapwing.services.common import status_texts
from lapwing.services.common.event_kinds import KINDS
from lapwing.services.common.mavlink.dialect import mavlink, message_class
from lapwing.services.mavlink.component_metadata import EVENTS, GENERAL, events, files
from lapwing.services.mavlink.events import arming_checks, definitions, flight
from lapwing.services.mavlink.resolve import describe
from lapwing.services.mavlink.vehicle_cache import CAPACITY, EventLog
from lapwing.services.scene_resolver import load

NUMBERS = {"uint8_t": "B", "uint16_t": "H", "uint32_t": "I", "float": "f"}


class Reader:
    """Reader of a ground station: requests missing events, and inserts the arguments in the texts."""

    def __init__(self, station, described):
        self.station, self.events, self.lost, self.last = station, [], 0, None
        self.component = described["components"]["1"]
        self.known = {
            int(sub_id): (group, event)
            for group, content in self.component["event_groups"].items()
            for sub_id, event in content["events"].items()
        }
        self.newest = None
        station.on_message, station.step = self.take, self.step

    def step(self):
        """Repeat the request, like a timer of 0.1 s."""
        if self.newest is not None and 0 < (self.newest - self.last) % 65536 < 32768:
            self.request()

    def take(self, m):
        kind = m.get_type()
        if kind == "CURRENT_EVENT_SEQUENCE":
            if m.flags & 1 or self.last is None:
                self.last = m.sequence
            self.newest = m.sequence
        elif kind == "RESPONSE_EVENT_ERROR" and m.sequence == (self.last + 1) % 65536:
            self.lost += (m.sequence_oldest_available - self.last - 1) % 65536
            self.last = (m.sequence_oldest_available - 1) % 65536
            self.request()
        elif kind == "EVENT":
            if self.last is None:
                self.last = (m.sequence - 1) % 65536
            gap = (m.sequence - self.last - 1) % 65536
            if gap == 0:
                self.last = m.sequence
                self.events.append(self.read(m))
            elif gap < 32768:
                self.request()

    def request(self):
        expected = (self.last + 1) % 65536
        self.station.send_own("REQUEST_EVENT", 1, 1, expected, expected)

    def values(self, m):
        group, event = self.known[m.id & 0xFFFFFF]
        result, offset = [], 0
        for argument in event.get("arguments", ()):
            kind = self.component["enums"].get(argument["type"], {"type": argument["type"]})
            layout = "<" + NUMBERS[kind["type"]]
            (value,) = struct.unpack_from(layout, bytes(m.arguments), offset)
            offset += struct.calcsize(layout)
            result.append((value, kind))
        return group, event, result

    def read(self, m):
        assert m.id >> 24 == 1
        group, event, values = self.values(m)

        def put(match):
            value, kind = values[int(match[1]) - 1]
            if "entries" not in kind:
                return f"{value:.{match[2]}f}" if match[2] else f"{value:g}"
            if not kind["is_bitfield"]:
                return kind["entries"][str(value)]["description"]
            return "|".join(kind["entries"][str(1 << k)]["description"] for k in range(32) if value >> k & 1)

        return group, event["name"], re.sub(r"\{(\d)(?::\.(\d))?[^}]*\}", put, event["message"])

    def texts(self, group="default"):
        return [text for of, _, text in self.events if of == group]


def reader(bench, **more):
    result = Reader(station := bench.station(**more), events())
    station.send_own = lambda name, *fields: station.raw(message_class(name)(*fields).pack(station.codec))
    return result


def test_messages_equal_common_xml():
    published = {410: (160, 53), 411: (106, 3), 412: (33, 6), 413: (77, 7)}  # mavlink/common.h: CRC_EXTRA, length
    for number, (seed, length) in published.items():
        result = mavlink.mavlink_map[number]
        assert (result.crc_extra, result.unpacker.size) == (seed, length)


def test_flight_is_reported():
    bench = Bench()
    one = reader(bench)
    bench.step(5)
    bench.vehicle.position = [0.0, 0.0, 5.0]
    bench.vehicle.armed = True
    bench.step()
    bench.vehicle.mode, bench.vehicle.landed = "takeoff", False
    bench.step()
    bench.vehicle.mode = "orbit"
    bench.step()
    bench.vehicle.status = {"failsafe": True, "text": status_texts.SETPOINTS_LOST, "mode": "hold"}
    bench.step()
    bench.vehicle.status = {"battery_warning": 2, "failed_motor": 3}
    bench.vehicle.mode = "land"
    bench.step()
    bench.vehicle.status, bench.vehicle.armed, bench.vehicle.landed = {}, False, True
    bench.step()
    assert one.texts() == [
        "Armed", "Flight mode: takeoff", "Takeoff detected", "Flight mode: orbit", "Flight mode: hold",
        f"Failsafe: {status_texts.SETPOINTS_LOST}, now hold", "Flight mode: land", "Low battery", "Critical battery",
        "Motor 3 has failed", "Failsafe is over", "Landing detected", "Disarmed: on the ground",
    ]  # fmt: skip
    assert not one.lost


@pytest.mark.parametrize("reason", status_texts.FAILSAFES)
def test_every_failsafe_has_number(reason):
    bench = Bench()
    one = reader(bench)
    bench.step(2)
    bench.vehicle.status = {"failsafe": True, "text": reason}
    bench.step()
    assert one.texts()[-1] == f"Failsafe: {reason}, now hold"


def test_contact_and_saturation_are_reported():
    bench = Bench()
    one = reader(bench)
    highest = bench.adapter.vehicle.description.max_voltage
    bench.vehicle.armed, bench.vehicle.landed = True, False
    bench.vehicle.more = [(TRUTH, VehicleState()), (ACTUATORS, Actuators())]
    bench.step(3)
    bench.vehicle.more = [(ACTUATORS, Actuators(motor_voltage=(0.5 * highest, highest, 0.3, 0.0)))]
    bench.step(40)
    assert "Motor 2|4 at the limit" not in one.texts()
    bench.step(100)
    bench.vehicle.more = [(TRUTH, VehicleState(ground_contact=True))]
    bench.step(3)
    assert one.texts().count("Motor 2|4 at the limit") == 1
    assert one.texts()[-1] == "Touches the ground"


@pytest.mark.parametrize("seed", range(5))
def test_lost_events_are_sent_again_on_request(seed):
    bench = Bench()
    one, sound = reader(bench, loss=0.3, seed=seed), reader(bench)
    for k in range(60):
        bench.vehicle.armed = bool(k % 2)
        bench.step(3)
    bench.step(600)  # the number of the last one comes every 3 s
    whole = sound.texts()
    assert len(whole) == 59
    assert one.texts() == whole[len(whole) - len(one.texts()) :]
    assert len(one.texts()) >= 55  # events before the first received one are not requested
    assert not one.lost


def test_expired_event_request_names_oldest_available():
    log = EventLog()
    for k in range(CAPACITY + 5):
        log.add(1, 6, bytes([k]), k)
    (error,) = log.replies(3, 3, (255, 190))
    assert (error.target_system, error.sequence, error.sequence_oldest_available) == (255, 3, 6)
    result = list(log.replies(6, 8, (255, 190)))
    assert [(m.get_type(), m.sequence) for m in result] == [("EVENT", 6), ("EVENT", 7), ("EVENT", 8)]
    everything = list(
        log.replies(106, 105, (255, 190))
    )  # all sequence numbers: an error for the range that is not stored
    assert len(everything) == CAPACITY + 1
    assert everything[0].get_type() == "RESPONSE_EVENT_ERROR"


def test_sequence_numbers_wrap_around():
    log = EventLog()
    log.sequence = 65534
    assert log.current().flags == 1
    for k in range(3):
        log.add(1, 6, b"", k)
    assert log.current().flags == 0
    assert [m.sequence for m in log.replies(65535, 1, (255, 190))] == [65535, 0, 1]


def test_arming_checks_are_reported_in_protocol_order():
    bench = Bench()
    bench.vehicle.arming_blockers = (
        status_texts.NO_READINGS.format("gps"),
        f"{status_texts.BATTERY_LOW}: 6%",
        status_texts.NOT_LEVEL,
        "a reason of tomorrow",
    )
    one = reader(bench)
    bench.step(2)
    result = [(group, name) for group, name, _ in one.events]
    assert result[0] == ("arming_check", "arming_check_summary")
    assert result[-1] == ("health", "health_summary")
    assert one.texts("arming_check")[1:] == [
        "No good readings of the gps",
        "The battery is low",
        "The vehicle is not level",
        "The vehicle cannot be armed",
    ]
    messages = one.station.all("EVENT")
    _, _, summary = one.values(messages[0])
    assert summary[3][0] == 0  # can_arm
    bench.vehicle.arming_blockers = ()
    bench.step(60)
    _, event, summary = one.values(one.station.all("EVENT")[-2])
    assert event["type"] == "summary"
    assert summary[1][0] == 0
    assert summary[3][0] == (1 << len(arming_checks.MODES)) - 1


def test_report_is_sent_on_change_and_to_new_station():
    bench = Bench()
    one = reader(bench)
    bench.step(100)
    one.events.clear()
    bench.step(300)
    assert not one.events
    two = bench.station(system=254, heartbeat=False)
    two.send("heartbeat", 6, 8, 0, 0, 0, 3)
    bench.step(2)
    assert [name for _, name, _ in one.events] == ["arming_check_summary", "health_summary"]
    two.send("heartbeat", 6, 8, 0, 0, 0, 3)
    bench.step(100)
    assert len(one.events) == 2


def test_report_is_sent_on_request():
    bench = Bench()
    one = reader(bench)
    bench.step(100)
    one.events.clear()
    assert one.station.command(mavlink.MAV_CMD_RUN_PREARM_CHECKS) == mavlink.MAV_RESULT_ACCEPTED
    bench.step(10)
    assert [name for _, name, _ in one.events] == ["arming_check_summary", "health_summary"]


def test_texts_with_event_end_with_tab():
    bench = Bench()
    station = bench.station()
    bench.vehicle.text = ["armed", "the position is lost: descend in 9 s", "the position is lost: hold"]
    bench.step()
    bench.vehicle.status = {"failsafe": True, "text": "the position is lost"}
    bench.vehicle.text = ["the position is lost: hold", "the position is lost: hold"]
    bench.step()
    reported = [m.text for m in station.all("STATUSTEXT")]
    severities = [m.severity for m in station.all("STATUSTEXT")]
    information, warning, critical = (getattr(mavlink, f"MAV_SEVERITY_{s}") for s in ("INFO", "WARNING", "CRITICAL"))
    assert severities == [information, warning, warning, critical, critical]
    last = "the position is lost: hold"
    assert reported == [
        "armed\t",
        "the position is lost: descend in 9 s",
        last,
        f"{last}\t",
        last,
    ]  # once for one event


def test_ardupilot_stations_get_texts_without_events():
    bench = Bench("mavlink.firmware=ardupilot")
    station = bench.station()
    bench.vehicle.text = ["armed"]
    bench.vehicle.armed = True
    bench.step(200)
    assert not station.all("EVENT")
    assert not station.all("CURRENT_EVENT_SEQUENCE")
    assert station.last("STATUSTEXT").text == "armed"
    result = files(describe(load("lapwing/scenes/hover.toml", ["mavlink.firmware=ardupilot"])))
    assert EVENTS not in result
    assert GENERAL in result


def test_every_autopilot_text_has_number():
    assert {failsafe.reason for failsafe in FAILSAFES} == set(status_texts.FAILSAFES)
    assert set(MODES) <= set(flight.MODES)
    assert set(NAMES) <= set(arming_checks.SOURCES)
    entered = [mode for mode in arming_checks.MODES if not MODES[mode].needs_position]
    assert set(entered) == set(arming_checks.WITHOUT_POSITION)


def test_every_event_kind_has_definition():
    # of the models, a trajectory, a load, the whole flight, and of commands, which have acknowledgements
    not_of_the_link = {"warning", "phase", "slack", "crash", "refused"}
    assert {d.kind for d in definitions().values()} == set(KINDS) - not_of_the_link


def test_metadata_follows_rules_of_libevents():
    described = json.loads(files(describe(load("lapwing/scenes/groundstation.toml")))[EVENTS])
    assert described["version"] == 2
    component = described["components"]["1"]
    assert re.fullmatch("[a-z][a-z0-9_]*", component["namespace"])
    names = [event["name"] for group in component["event_groups"].values() for event in group["events"].values()]
    assert len(set(names)) == len(names) == len(definitions())
    for name, enumeration in component["enums"].items():
        assert re.fullmatch("[a-zA-Z][a-zA-Z0-9_]*_t", name)
        for entry in enumeration["entries"].values():
            assert re.fullmatch("[a-z][a-z0-9_]*", entry["name"])
            assert "\n" not in entry["description"]
    for group, content in component["event_groups"].items():
        assert group in ("default", "health", "arming_check")
        for event in content["events"].values():
            assert re.fullmatch(r"[^\n]{1,120}", event["message"])
            types = [component["enums"].get(a["type"], {"type": a["type"]})["type"] for a in event.get("arguments", ())]
            assert struct.calcsize("<" + "".join(NUMBERS[t] for t in types)) <= 40  # room in EVENT
            if group != "default" and event.get("type") != "summary":
                assert [a["name"] for a in event["arguments"]][1] == "health_component_index"
                assert types[1] == "uint8_t"
    groups = component["navigation_mode_groups"]["groups"]
    assert {str(k) for k in range(len(arming_checks.MODES))} == set(groups)
