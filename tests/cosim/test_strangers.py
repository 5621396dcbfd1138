"""Messages from outside the run are counted and change nothing."""

import json
import os
import signal
import stat
import subprocess
import sys
import time
from pathlib import Path

import pytest

from lapwing.cosim.access.private_sockets import private_endpoints
from lapwing.cosim.access.publisher_ids import PublisherIds, new_secret
from lapwing.cosim.config.serialise import to_json
from lapwing.cosim.log import LogReader
from lapwing.cosim.transport.bus import ZenohBus
from lapwing.cosim.transport.bus_keys import ALIVE_KEY, BATCH_KEY, CONFIG_KEY, DIVERGED_KEY, ENDED_KEY, STEP_KEY
from lapwing.cosim.transport.session_settings import mesh
from lapwing.messages.attachment import pack
from lapwing.services.common.operator_inbox import OPERATOR_KEY
from lapwing.services.scene_resolver import load, resolve
from tests.endpoints import absent
from tests.participants import participants

pytestmark = pytest.mark.long

SCENE = "lapwing/scenes/hover.toml"
PREFIX = "test-strangers"


def test_gids_depend_on_run_and_participant():
    run, other = PublisherIds(PREFIX, new_secret(), ["autopilot"]), PublisherIds(PREFIX, new_secret())
    assert len({run.gid("plant"), run.gid("sensors"), other.gid("plant"), PublisherIds("x").gid("plant")}) == 4
    assert len(run.gid("plant")) == 16
    assert run.senders(STEP_KEY, ["autopilot", "plant"]) == {
        f"{PREFIX}/_step/autopilot": None,
        f"{PREFIX}/_step/plant": run.gid("plant"),
    }
    # a process of Lapwing makes its messages
    assert run.senders(BATCH_KEY, ["autopilot"]) == {f"{PREFIX}/_batch/autopilot": run.gid("autopilot_messages")}


def arrivals(subscription):
    result = []
    while (message := subscription.get(timeout=0.5)) is not None:
        result.append(message)
    return result


def test_only_messages_of_expected_sender_are_received():
    mine, key = PublisherIds(PREFIX, new_secret()), f"{PREFIX}/_step/plant"
    with private_endpoints(["a", "b", "c"]) as ends, ZenohBus(*mesh("a", ends)) as bus:
        received = bus.receive(mine.senders(STEP_KEY, ["plant"]))
        first_comer = bus.receive({f"{PREFIX}/free": None})
        with ZenohBus(*mesh("b", ends), gid=mine.gid("plant")) as plant, ZenohBus([ends["c"]], [ends["a"]]) as stranger:
            zenoh = stranger._session
            for bus_ in (plant, stranger):
                bus_.declare_liveliness(f"{PREFIX}/{ALIVE_KEY}/{'plant' if bus_ is plant else 'stranger'}")
            assert not absent(bus, [f"{PREFIX}/{ALIVE_KEY}/{name}" for name in ("plant", "stranger")], 10.0)
            stranger.publisher(key)(b"", 0)
            zenoh.put(key, b"")
            zenoh.put(key, b"hello", attachment=b"short")
            zenoh.put(f"{PREFIX}/**", b"hello", attachment=pack(1, 0, bytes(16)))
            zenoh.delete(key)
            plant.publisher(key)(b"bundle", 4)
            assert arrivals(received) == [(4, b"bundle")]
            assert bus.rejected >= 5
            plant.publisher(f"{PREFIX}/free")(b"one", 1)
            assert first_comer.get(2.0) == (1, b"one")
            stranger.publisher(f"{PREFIX}/free")(b"two", 2)
            assert arrivals(first_comer) == []


def test_sockets_are_in_private_folder():
    with private_endpoints(["plant"]) as ends:
        folder = Path(ends["plant"].removeprefix("unixsock-stream/")).parent
        assert stat.S_IMODE(folder.stat().st_mode) == 0o700
        assert folder.stat().st_uid == os.getuid()
    assert not folder.exists()


def test_sockets_work_in_long_temporary_folder(monkeypatch, tmp_path):
    long = tmp_path / ("x" * 90)
    long.mkdir()
    monkeypatch.setattr("tempfile.tempdir", str(long))
    with private_endpoints(["autopilot_messages"]) as ends, ZenohBus(list(ends.values())):
        pass


def fly(tmp_path, *more):
    command = [sys.executable, "-m", "lapwing", "run", SCENE, "--key-prefix", PREFIX]
    command += ["--log", str(tmp_path / "log.mcap"), "--json", str(tmp_path / "run.json"), *more]
    pipe = subprocess.PIPE
    return subprocess.Popen(
        command, stdout=pipe, stderr=pipe, text=True, env={**os.environ, "TMPDIR": str(tmp_path), "COLUMNS": "200"}
    )


def listening(pid):
    """Return the TCP ports at which a process listens."""
    inodes = set()
    for entry in os.scandir(f"/proc/{pid}/fd"):
        try:
            inodes.add(os.readlink(entry.path).removeprefix("socket:[").removesuffix("]"))
        except OSError:
            continue
    rows = [line.split() for table in ("tcp", "tcp6") for line in Path(f"/proc/net/{table}").read_text().splitlines()]
    return [row[1] for row in rows if row[3] == "0A" and row[9] in inodes]


@pytest.mark.skipif(not Path("/proc/net/tcp").exists(), reason="finds ports in /proc")
def test_unauthenticated_messages_do_not_change_flight(tmp_path):
    """Send messages as the same user through the private sockets."""
    (tmp_path / "calm").mkdir()
    short = ["--set", "run.duration=3"]
    calm = fly(tmp_path / "calm", *short)
    assert calm.wait(200) == 0
    run = fly(tmp_path, *short, "--speed", "1")
    names = {"plant", "autopilot", "trajectory", "recorder", "mission"}
    while not (sockets := {s.name: s for s in tmp_path.glob("lapwing-*/*") if s.is_socket()}).keys() >= names:
        assert run.poll() is None, run.communicate()
        time.sleep(0.05)
    while (flying := participants(run.pid)).keys() != names - {"mission"}:  # unused early processes are ending
        assert run.poll() is None, run.communicate()
        time.sleep(0.05)
    assert not any(listening(pid) for pid in [run.pid, *flying.values()])

    ends = [f"unixsock-stream/{socket}" for socket in sockets.values()]
    with ZenohBus(connect=ends) as stranger:
        keys = [f"{PREFIX}/{OPERATOR_KEY}/mavlink"]
        keys += [f"{PREFIX}/{key}/{name}" for key in (STEP_KEY, BATCH_KEY, ENDED_KEY, DIVERGED_KEY) for name in names]
        while run.poll() is None:
            for key in [*keys, f"{PREFIX}/**"]:
                for payload in (b"", b"hello"):
                    stranger.publisher(key)(payload, 0)
                    stranger._session.put(key, payload)
            time.sleep(0.05)
    output, wrong = run.communicate()
    assert (run.returncode, wrong) == (0, "")
    assert "messages from outside the run" in output
    assert (
        json.loads((tmp_path / "run.json").read_text())["digest"]
        == (json.loads((tmp_path / "calm/run.json").read_text())["digest"])
    )


def test_external_service_with_other_configuration_is_rejected(tmp_path):
    other = to_json(resolve(load(SCENE, {"run.duration": 9.0}))).encode()
    with private_endpoints(["autopilot"]) as ends, ZenohBus([ends["autopilot"]]) as program:
        program.answer(f"{PREFIX}/{CONFIG_KEY}/autopilot", other)
        run = fly(tmp_path, "--external", f"autopilot={ends['autopilot']}")
        program.declare_liveliness(f"{PREFIX}/{ALIVE_KEY}/autopilot")
        _, output = run.communicate(timeout=120)
    assert run.returncode == 2
    assert output.startswith("lapwing: autopilot_messages: last_tick is ")
    assert "2250 in autopilot; start all services from the same scene" in output
    assert output.count("\n") == 1


@pytest.mark.long
def test_run_says_that_it_waits_for_external_service(tmp_path):
    with private_endpoints(["autopilot"]) as ends:
        run = fly(tmp_path, "--external", f"autopilot={ends['autopilot']}")
        while "waiting for autopilot to join" not in (line := run.stdout.readline()):
            assert line, run.communicate()
        run.send_signal(signal.SIGINT)
        run.communicate(timeout=120)
    assert run.returncode == 130


def test_early_end_of_external_service_fails_run(tmp_path):
    with private_endpoints(["autopilot"]) as ends, ZenohBus([ends["autopilot"]]) as program:
        run = fly(tmp_path, "--external", f"autopilot={ends['autopilot']}")
        program.declare_liveliness(f"{PREFIX}/{ALIVE_KEY}/autopilot")
        others = ("plant", "trajectory", "recorder", "autopilot_messages")
        assert not absent(program, [f"{PREFIX}/{ALIVE_KEY}/{name}" for name in others], 120.0)
        program.publisher(f"{PREFIX}/{STEP_KEY}/autopilot")(b"", 0)
        _, output = run.communicate(timeout=120)
    assert run.returncode == 1
    assert output.startswith("lapwing: the run ended early at t = ")
    assert "autopilot ended before the run did" in output
    assert output.count("\n") == 1
    with LogReader(tmp_path / "log.mcap") as log:
        assert log.metadata["failure"] == "autopilot ended before the run did"
