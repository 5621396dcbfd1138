"""Signed links: only frames with the key are accepted, each once; without a key only local commands."""

import hashlib

import pytest
from adapter_harness import Bench

from lapwing.services.common.mavlink.dialect import mavlink
from lapwing.services.mavlink.signing import TimeStampStore, read_key

KEY = hashlib.sha256(b"correct horse").digest()
REFUSED = "unsigned, forged or replayed"
ARM = (1, 1, 400, 0, 1.0, *(0.0,) * 6)


def test_signed_commands_get_signed_acknowledgements():
    bench = Bench(key=KEY)
    station = bench.station(key=KEY, local=False)
    station.send("command_long", *ARM)
    bench.step(3)
    assert bench.vehicle.armed
    assert station.last("COMMAND_ACK").get_signed()


@pytest.mark.parametrize("key", [None, hashlib.sha256(b"wrong").digest()])
def test_unsigned_and_forged_frames_are_rejected_and_counted(key):
    bench = Bench(key=KEY)
    station = bench.station(key=key)
    station.send("command_long", *ARM)
    bench.step(3)
    assert not bench.vehicle.armed
    assert bench.counts[REFUSED] == 1


def test_replayed_packet_is_rejected_on_other_endpoint():
    bench = Bench(key=KEY)
    station, thief = bench.station(key=KEY), bench.station(local=False)
    station.send("command_long", *ARM)
    bench.step(3)
    bench.vehicle.armed = False
    station.raw(station.sent[0])
    thief.raw(station.sent[0])
    bench.step(3)
    assert not bench.vehicle.armed
    assert bench.counts[REFUSED] == 2


def test_forged_time_stamp_does_not_block_valid_sender():
    bench = Bench(key=KEY)
    station = bench.station(key=KEY)
    station.send("heartbeat", 6, 8, 0, 0, 0, 3)
    forger = bench.station(key=hashlib.sha256(b"wrong").digest())
    forger.codec.signing.timestamp += 10**12
    forger.send("command_long", *ARM)
    station.send("command_long", *ARM)
    bench.step(3)
    assert bench.counts[REFUSED] == 1
    assert bench.vehicle.armed


def test_without_key_other_machines_get_telemetry_only():
    bench = Bench()
    stranger = bench.station(local=False)
    assert stranger.command(400, 1.0) == mavlink.MAV_RESULT_DENIED
    assert stranger.command(512, 242.0) == mavlink.MAV_RESULT_ACCEPTED
    assert stranger.last("HOME_POSITION")
    stranger.send("param_set", 1, 1, b"MPC_XY_P", 3.0, mavlink.MAV_PARAM_TYPE_REAL32)
    stranger.send("mission_count", 1, 1, 1, 0)
    stranger.send("mission_clear_all", 1, 1, 0)
    stranger.send("set_mode", 1, 1, 4 << 16 | 5 << 24)
    stranger.send("manual_control", 1, 1000, 0, 500, 0, 0)
    stranger.send("heartbeat", 6, 8, 0, 0, 0, 3)
    bench.step(60)
    assert bench.vehicle.kinds == {}
    assert stranger.last("PARAM_ERROR").error == mavlink.MAV_PARAM_ERROR_PERMISSION_DENIED
    assert {m.type for m in stranger.all("MISSION_ACK")} == {mavlink.MAV_MISSION_DENIED}


def test_insecure_accepts_remote_commands():
    bench = Bench(insecure=True)
    assert bench.station(local=False).command(400, 1.0) == mavlink.MAV_RESULT_ACCEPTED


def test_command_needs_heartbeat_of_its_endpoint():
    bench = Bench()
    bench.station()
    station = bench.station(heartbeat=False)
    assert station.command(400, 1.0) == mavlink.MAV_RESULT_DENIED
    assert "HEARTBEAT" in station.last("STATUSTEXT").text
    station.send("set_mode", 1, 1, 4 << 16 | 5 << 24)
    station.send("manual_control", 1, 1000, 0, 500, 0, 0)
    bench.step(3)
    assert set(bench.vehicle.kinds) <= {"link"}
    station.send("heartbeat", 6, 8, 0, 0, 0, 3)
    assert station.command(400, 1.0) == mavlink.MAV_RESULT_ACCEPTED


def test_replayed_packet_is_rejected_after_restart(tmp_path):
    path = tmp_path / "state" / "stamps"
    bench = Bench(key=KEY, time_stamps=path)
    station = bench.station(key=KEY)
    station.send("command_long", *ARM)
    bench.step(3)
    assert bench.vehicle.armed
    bench = Bench(key=KEY, time_stamps=path)  # the first one was not closed, as after a kill
    thief = bench.station()
    thief.raw(station.sent[0])
    bench.step(3)
    assert not bench.vehicle.armed
    assert bench.counts[REFUSED] == 1
    station = bench.station(key=KEY)
    station.send("command_long", *ARM)
    bench.step(3)
    assert bench.vehicle.armed
    assert path.stat().st_mode & 0o077 == 0


def test_stored_time_stamps_belong_to_key_and_vehicle(tmp_path):
    store = TimeStampStore(tmp_path / "stamps", KEY, 1)
    store.put((0, 255, 190), 7)
    store.put((0, 255, 190), 5)
    assert store.load() == {(0, 255, 190): 7}
    assert TimeStampStore(tmp_path / "stamps", KEY, 2).load() == {}
    assert TimeStampStore(tmp_path / "stamps", bytes(32), 1).load() == {}


def test_new_stream_older_than_minute_is_rejected():
    bench = Bench(key=KEY)
    old = bench.station(key=KEY)
    old.codec.signing.timestamp -= 61 * 10**5
    old.send("command_long", *ARM)
    bench.step(3)
    assert not bench.vehicle.armed


def test_key_file_has_one_passphrase(tmp_path):
    path = tmp_path / "key"
    path.write_text("correct horse\n")
    assert read_key(path) == KEY
    for text in ("", "short", "two lines of\ntext"):
        path.write_text(text)
        with pytest.raises(ValueError, match=r"--mavlink-key .*: expected one line"):
            read_key(path)
    with pytest.raises(ValueError, match="cannot be read"):
        read_key(tmp_path / "none")
