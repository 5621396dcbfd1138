"""Participants on several hosts compare their configurations and check certificates before a flight."""

import subprocess
import sys

import pytest

from lapwing.cosim.access.certificates import make, tls
from lapwing.cosim.access.publisher_ids import PublisherIds
from lapwing.cosim.access.zenoh_access import VIEWER, by_certificate
from lapwing.cosim.log import LogReader
from lapwing.cosim.run_errors import BusError
from lapwing.cosim.transport.bus import ZenohBus
from lapwing.cosim.transport.bus_keys import ALIVE_KEY, ENDED_KEY, STEP_KEY
from lapwing.runs.single_process_run import fly_single
from lapwing.services.common.operator_inbox import OPERATOR_KEY
from lapwing.services.process_table import MAVLINK
from lapwing.services.scene_resolver import load, resolve
from lapwing.services.security import publish_permissions
from tests.endpoints import absent, loopback_endpoints

pytestmark = pytest.mark.long

SCENE = "lapwing/scenes/gyrostat_blocked.toml"
PATIENCE = 300.0  # [s] for processes that start on a busy machine


def participant(name, peers, tmp_path, *more, insecure=True):
    table = ",".join(f"{key}={endpoint}" for key, endpoint in peers.items())
    command = [
        sys.executable,
        "-m",
        "lapwing",
        "service",
        name,
        SCENE,
        "--endpoints",
        table,
        "--key-prefix",
        "test-join",
        *more,
        *(["--insecure"] if insecure and "--keys" not in more else []),
    ]
    return subprocess.Popen(command, stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True)


def test_participant_with_other_configuration_is_rejected(tmp_path):
    peers = loopback_endpoints(["plant", "recorder"])
    short = ("--set", "run.duration=50.0")
    plant = participant("plant", peers, tmp_path, *short, "--set", "gyrostat.inertia=[500.0,501.0,1000.0]")
    log = str(tmp_path / "log.mcap")
    recorder = participant("recorder", peers, tmp_path, *short, "--log", log)
    for process in (plant, recorder):
        _, output = process.communicate(timeout=PATIENCE)
        assert process.returncode == 2, output
        assert "services.plant.parameters.core.system.inertia.1" in output
        assert "501.0" in output
        assert "500.0" in output
        assert len(output.splitlines()) == 1


def test_digest_over_certified_links_equals_single_process(tmp_path):
    keys, log, alone = tmp_path / "keys", tmp_path / "log.mcap", tmp_path / "alone.mcap"
    make(keys, ["plant", "recorder"], 1)
    peers = {name: end.replace("tcp/", "tls/") for name, end in loopback_endpoints(["plant", "recorder"]).items()}
    more = ("--set", "run.duration=50.0", "--keys", str(keys))
    plant = participant("plant", peers, tmp_path, *more)
    recorder = participant("recorder", peers, tmp_path, *more, "--log", str(log))
    for process in (plant, recorder):
        _, output = process.communicate(timeout=PATIENCE)
        assert process.returncode == 0, output
    fly_single(resolve(load(SCENE, ["run.duration=50.0"])), alone)
    with LogReader(log) as read, LogReader(alone) as expected:
        assert read.digest() == expected.digest()


def test_start_without_certificate_needs_insecure(tmp_path):
    peers = loopback_endpoints(["plant", "recorder"])
    plant = participant("plant", peers, tmp_path, insecure=False)
    _, output = plant.communicate(timeout=PATIENCE)
    assert plant.returncode == 2
    assert "endpoint is not authenticated; use tls/HOST:PORT with --keys FOLDER, or --insecure" in output


def test_participant_cannot_publish_for_others(tmp_path):
    """Access control drops the messages at both ends of a link, even with the publisher ids of others."""
    keys, run = tmp_path / "keys", PublisherIds("test-access")
    make(keys, ["plant", "sensors"], 1)
    config = resolve(load("delivery_mission"))
    rules = by_certificate("test-access", publish_permissions(config, "test-access"))
    (end,) = (each.replace("tcp/", "tls/") for each in loopback_endpoints(["plant"]).values())
    with (
        ZenohBus([end], gid=run.gid("plant"), security={**tls(keys, "plant"), **rules}) as plant,
        ZenohBus(connect=[end], gid=run.gid("sensors"), security={**tls(keys, "sensors"), **rules}) as sensors,
    ):
        pairs = (("plant", plant, "sensors"), ("sensors", sensors, "plant"))
        received = {name: bus.receive(run.senders(STEP_KEY, [other, "autopilot"])) for name, bus, other in pairs}
        for name, bus, _ in pairs:
            bus.declare_liveliness(f"test-access/{ALIVE_KEY}/{name}")
        for _, bus, other in pairs:
            assert not absent(bus, [f"test-access/{ALIVE_KEY}/{other}"], PATIENCE)
        for name, bus, _ in pairs:
            own, bus._gid = bus._gid, run.gid("autopilot")
            bus.publisher(f"test-access/{STEP_KEY}/autopilot")(b"forged", 0)
            bus._gid = own
            bus.publisher(f"test-access/{STEP_KEY}/{name}")(b"own", 0)
        for name, bus, other in pairs:
            messages = [received[name].get_with_key(timeout=PATIENCE) for _ in range(2)]
            # a session receives its own messages unfiltered
            assert sorted(messages) == [
                (f"test-access/{STEP_KEY}/autopilot", 0, b"forged"),
                (f"test-access/{STEP_KEY}/{other}", 0, b"own"),
            ]
            assert received[name].get_with_key(timeout=1.0) is None
            assert bus.rejected == 0


def test_viewer_reads_only_and_needs_certificate(tmp_path):
    keys, run = tmp_path / "keys", PublisherIds("test-viewer")
    make(keys, ["autopilot", VIEWER], 1)
    rules = by_certificate("test-viewer", publish_permissions(resolve(load("groundstation")), "test-viewer"))
    (end,) = (each.replace("tcp/", "tls/") for each in loopback_endpoints(["autopilot"]).values())
    gid, topic, bundles = run.gid("autopilot"), "test-viewer/drone1/status", f"test-viewer/{STEP_KEY}/autopilot"
    with (
        ZenohBus([end], gid=gid, security={**tls(keys, "autopilot"), **rules}) as autopilot,
        ZenohBus(connect=[end], mode="client", gid=run.gid(MAVLINK), security=tls(keys, VIEWER)) as viewer,
    ):
        withheld = viewer.subscribe(f"test-viewer/{STEP_KEY}/*")
        received, read = autopilot.subscribe("test-viewer/**"), viewer.subscribe(topic)
        publish, step = autopilot.publisher(topic), autopilot.publisher(bundles)
        while (message := read.get(timeout=0.1)) is None:  # until the subscriptions have arrived
            step(b"bundle", 0)
            publish(b"status", 0)
        assert message == (0, b"status")
        assert withheld.get(timeout=0.5) is None
        for key in (f"{OPERATOR_KEY}/{MAVLINK}", f"{STEP_KEY}/plant", f"{ENDED_KEY}/plant", f"{ALIVE_KEY}/plant"):
            viewer.publisher(f"test-viewer/{key}")(b"command", 0)
            viewer._session.put(f"test-viewer/{key}", b"command")
            viewer._session.delete(f"test-viewer/{key}")
        viewer.declare_liveliness(f"test-viewer/{ALIVE_KEY}/plant")
        assert absent(autopilot, [f"test-viewer/{ALIVE_KEY}/plant"], 1.0)  # still absent
        while (message := received.get_with_key(timeout=1.0)) is not None:
            assert message in ((topic, 0, b"status"), (bundles, 0, b"bundle"))  # own messages
        with pytest.raises(BusError):
            ZenohBus(connect=[end], mode="client").close()
