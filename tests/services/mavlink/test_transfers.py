"""Missions and parameters over a lossy link: one in ten datagrams is lost in each direction, one in ten doubled."""

import struct

import pytest
from adapter_harness import Bench, Station, item
from fake_vehicle import PARAMETERS

from lapwing.services.common.mavlink.dialect import mavlink

BAD = {"loss": 0.1, "twice": 0.1}


class RetryingStation(Station):
    """Station that repeats its requests after half a second, like ground stations."""

    def step(self):
        self.age = getattr(self, "age", 0) + 1
        if self.age % 25 == 0:
            self.again()

    def again(self):
        pass

    def upload(self, items):
        def answer(m):
            if m.get_type() == "MISSION_REQUEST_INT":
                self.age = 0
                self.send("mission_item_int", *items[m.seq])

        def again():
            if not self.all("MISSION_REQUEST_INT"):
                self.send("mission_count", 1, 1, len(items), 0)

        self.on_message, self.again = answer, again
        self.send("mission_count", 1, 1, len(items), 0)
        assert self.bench.until(lambda: self.last("MISSION_ACK"), 60.0)
        return self.last("MISSION_ACK").type

    def download(self):
        result = {}

        def request():
            if (count := self.last("MISSION_COUNT")) is None:
                self.send("mission_request_list", 1, 1, 0)
            elif len(result) < count.count:
                self.send("mission_request_int", 1, 1, len(result), 0)

        def answer(m):
            if m.get_type() == "MISSION_ITEM_INT" and m.seq == len(result):
                result[m.seq] = m
            if m.get_type() in ("MISSION_COUNT", "MISSION_ITEM_INT"):
                request()

        self.on_message, self.again = answer, request
        request()
        assert self.bench.until(
            lambda: self.last("MISSION_COUNT") and len(result) == self.last("MISSION_COUNT").count, 60
        )
        return list(result.values())

    def parameters(self):
        result = {}

        def count():
            return next(iter(result.values())).param_count if result else 0

        def answer(m):
            if m.get_type() == "PARAM_VALUE":
                result[m.param_index] = m

        def again():
            for index in set(range(count())) - set(result):
                self.send("param_request_read", 1, 1, b"", index)
            if not result:
                self.send("param_request_list", 1, 1)

        self.on_message, self.again = answer, again
        self.send("param_request_list", 1, 1)
        assert self.bench.until(lambda: result and len(result) == count(), 60.0)
        return result


def retrying_station(bench, **more):
    result = RetryingStation(bench, **more)
    bench.stations.append(result)
    return result


def test_items_of_mission_show_in_landed_state():
    bench = Bench()
    client = retrying_station(bench)
    commands = (mavlink.MAV_CMD_NAV_TAKEOFF, mavlink.MAV_CMD_NAV_WAYPOINT, mavlink.MAV_CMD_NAV_LAND)
    assert client.upload([item(k, command) for k, command in enumerate(commands)]) == mavlink.MAV_MISSION_ACCEPTED
    shown = []
    for k in range(len(commands)):
        bench.vehicle.status = {"mode": "mission", "landed": False, "mission_current": k}
        client.got.clear()
        bench.step(60)
        shown.append(client.last("EXTENDED_SYS_STATE").landed_state)
    assert shown == [
        mavlink.MAV_LANDED_STATE_TAKEOFF,
        mavlink.MAV_LANDED_STATE_IN_AIR,
        mavlink.MAV_LANDED_STATE_LANDING,
    ]


@pytest.mark.parametrize("seed", range(5))
def test_transfers_complete_over_lossy_link(seed):
    bench = Bench()
    client = retrying_station(bench, seed=seed, **BAD)
    items = [item(k, north=float(k), up=2.0 + k) for k in range(60)]
    assert client.upload(items) == mavlink.MAV_MISSION_ACCEPTED
    assert [i.position.z for i in bench.vehicle.items] == pytest.approx([2.35 + k for k in range(60)], abs=1e-3)
    client.got.clear()
    assert [(m.x, m.z) for m in client.download()] == [(i[11], i[13]) for i in items]
    assert {p.name for p in PARAMETERS} < {m.param_id for m in client.parameters().values()}


@pytest.mark.parametrize("seed", range(4))
def test_transfers_are_fast_with_20_percent_loss(seed):
    bench = Bench()
    client = retrying_station(bench, seed=seed, loss=0.2)
    items = [item(k, north=float(k), up=2.0 + k) for k in range(50)]
    start = bench.vehicle.seconds
    assert client.upload(items) == mavlink.MAV_MISSION_ACCEPTED
    assert bench.vehicle.seconds - start < 10.0
    start = bench.vehicle.seconds
    client.parameters()
    assert bench.vehicle.seconds - start < 5.0


def test_lost_last_acknowledgement_is_repeated():
    bench = Bench()
    client = bench.station()
    client.send("mission_count", 1, 1, 1, 0)
    client.send("mission_item_int", *item(0))
    bench.step(2)
    assert len(client.all("MISSION_ACK")) == 1
    client.got.clear()
    bench.step(100)
    assert [m.type for m in client.all("MISSION_ACK")] == [mavlink.MAV_MISSION_ACCEPTED] * 2
    client.send("mission_count", 1, 1, 1, 0)
    client.send("mission_item_int", *item(0))
    bench.step(2)
    client.got.clear()
    client.send("mission_request_list", 1, 1, 0)  # the next request: the client has received it
    bench.step(100)
    assert not client.all("MISSION_ACK")


def test_items_arrive_in_any_order_and_more_than_once():
    bench = Bench()
    client = bench.station()
    client.send("mission_count", 1, 1, 3, 0)
    for seq in (2, 1, 0, 0, 2, 1, 1, 2, 0):
        client.send("mission_item_int", *item(seq, up=float(seq)))
    bench.step(3)
    assert client.last("MISSION_ACK").type == mavlink.MAV_MISSION_ACCEPTED
    assert [i.position.z for i in bench.vehicle.items] == pytest.approx([0.35, 1.35, 2.35], abs=1e-3)
    assert len(client.all("MISSION_ACK")) == 1


def test_second_concurrent_upload_is_rejected():
    bench = Bench()
    one, two = bench.station(), bench.station(system=254)
    one.send("mission_count", 1, 1, 2, 0)
    two.send("mission_count", 1, 1, 5, 0)
    assert two.last("MISSION_ACK").type == mavlink.MAV_MISSION_DENIED
    two.send("mission_item_int", *item(0, up=99.0))
    one.send("mission_item_int", *item(0))
    one.send("mission_item_int", *item(1))
    bench.step(3)
    assert one.last("MISSION_ACK").type == mavlink.MAV_MISSION_ACCEPTED
    assert [i.position.z for i in bench.vehicle.items] == pytest.approx([5.35, 5.35], abs=1e-3)
    two.send("mission_count", 1, 1, 1, 0)
    assert two.last("MISSION_REQUEST_INT").seq == 0


def test_stalled_upload_is_retried_then_cancelled():
    bench = Bench()
    client = bench.station()
    client.send("mission_count", 1, 1, 2, 0)
    bench.step(200)
    assert 5 <= len(client.all("MISSION_REQUEST_INT")) <= 10
    assert client.last("MISSION_ACK").type == mavlink.MAV_MISSION_OPERATION_CANCELLED
    assert bench.counts["upload timed out"] == 1


def test_acknowledgement_is_repeated_for_repeated_item():
    bench = Bench()
    client = bench.station()
    client.send("mission_count", 1, 1, 1, 0)
    client.send("mission_item_int", *item(0))
    bench.step(3)
    client.got.clear()
    client.send("mission_item_int", *item(0))
    assert client.last("MISSION_ACK").type == mavlink.MAV_MISSION_ACCEPTED


@pytest.mark.parametrize(
    ("changed", "result"),
    [
        ({"command": 23}, mavlink.MAV_MISSION_UNSUPPORTED),
        ({"frame": 1}, mavlink.MAV_MISSION_UNSUPPORTED_FRAME),
        ({"up": float("nan")}, mavlink.MAV_MISSION_INVALID_PARAM7),
        ({"up": float("inf")}, mavlink.MAV_MISSION_INVALID),
        ({"north": 1e7}, mavlink.MAV_MISSION_INVALID_PARAM5_X),
        ({"params": (-1.0, 0.0, 0.0, 0.0)}, mavlink.MAV_MISSION_INVALID_PARAM1),
        ({"params": (float("inf"), 0.0, 0.0, 0.0)}, mavlink.MAV_MISSION_INVALID),
        ({"command": 5001, "params": (3.0, 0.0, 0.0, 0.0)}, mavlink.MAV_MISSION_UNSUPPORTED),
    ],
)
def test_unsupported_item_keeps_old_mission(changed, result):
    bench = Bench()
    client = bench.station()
    for up, more in ((7.0, {}), (9.0, changed)):
        client.send("mission_count", 1, 1, 1, 0)
        client.send("mission_item_int", *item(0, **{"up": up} | more))
        bench.step(3)
    assert client.last("MISSION_ACK").type == result
    assert bench.vehicle.items[0].position.z == pytest.approx(7.35, abs=1e-3)


def test_camera_items_keep_their_index_without_effect():
    bench = Bench()
    client = bench.station()
    client.send("mission_count", 1, 1, 3, 0)
    for seq, command in enumerate((16, mavlink.MAV_CMD_IMAGE_START_CAPTURE, 16)):
        client.send("mission_item_int", *item(seq, command))
    bench.step(3)
    assert [(i.action, i.hold_time) for i in bench.vehicle.items] == [
        ("waypoint", 0.0),
        ("delay", 0.0),
        ("waypoint", 0.0),
    ]
    assert [m.text for m in client.all("STATUSTEXT")] == [
        "item 2, IMAGE_START_CAPTURE: skipped, the vehicle ",
        "has no camera",
    ]


def test_clear_all_sends_single_acknowledgement():
    bench = Bench()
    client = bench.station()
    client.send("mission_clear_all", 1, 1, mavlink.MAV_MISSION_TYPE_ALL)
    bench.step(3)
    assert [m.type for m in client.all("MISSION_ACK")] == [mavlink.MAV_MISSION_ACCEPTED]


def test_first_item_of_ardupilot_is_home():
    bench = Bench("mavlink.firmware=ardupilot")
    client = bench.station()
    client.send("mission_count", 1, 1, 2, 0)
    client.send("mission_item_int", *item(0, frame=0, up=280.0))
    client.send("mission_item_int", *item(1))
    bench.step(3)
    assert [i.action for i in bench.vehicle.items] == ["delay", "waypoint"]


def test_integer_parameters_are_sent_as_bytes_or_by_value():
    for overrides, wire in (((), struct.unpack("<f", struct.pack("<i", 3))[0]), (("mavlink.firmware=ardupilot",), 3.0)):
        bench = Bench(*overrides)
        client = bench.station()
        client.send("param_set", 1, 1, b"NAV_DLL_ACT", wire, mavlink.MAV_PARAM_TYPE_INT32)
        bench.step(3)
        assert bench.vehicle.parameters["NAV_DLL_ACT"] == 3.0
        assert client.last("PARAM_VALUE").param_value == wire


@pytest.mark.parametrize("value", [1e9, float("nan"), float("inf"), -5.0])
def test_parameter_out_of_bounds_is_rejected_with_value(value):
    bench = Bench()
    client = bench.station()
    client.send("param_set", 1, 1, b"MIS_TAKEOFF_ALT", value, mavlink.MAV_PARAM_TYPE_REAL32)
    bench.step(3)
    assert client.last("PARAM_ERROR").error == mavlink.MAV_PARAM_ERROR_VALUE_OUT_OF_RANGE
    assert client.last("PARAM_VALUE").param_value == 2.5
    client.send("param_request_read", 1, 1, b"NO_SUCH", -1)
    assert client.last("PARAM_ERROR").error == mavlink.MAV_PARAM_ERROR_DOES_NOT_EXIST
