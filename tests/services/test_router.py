"""Router: a client outside of the run receives messages, but cannot send any."""

import subprocess
import sys
import threading
import time

import pytest
import zenoh

from lapwing.cosim.access.certificates import make, tls
from lapwing.cosim.access.zenoh_access import VIEWER
from lapwing.cosim.run_errors import BusError
from lapwing.cosim.transport.bus import ZenohBus
from lapwing.cosim.transport.bus_keys import BATCH_KEY, DIVERGED_KEY, STEP_KEY
from lapwing.cosim.transport.session_settings import mesh
from lapwing.messages import PoseStamped
from lapwing.services.common.operator_inbox import OPERATOR_KEY
from lapwing.services.process_table import ROUTER
from lapwing.services.scene_resolver import load, resolve
from lapwing.services.security import settings
from tests.endpoints import loopback_endpoints

pytestmark = pytest.mark.long

PREFIX = "test-router"


def visit(command, endpoint, **security):
    """Return the client's messages during a run and the run's output; the client also publishes."""
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True) as run:
        received = None
        while received is None and run.poll() is None:
            try:
                with ZenohBus(connect=[endpoint], mode="client", **security) as bus:
                    pose = bus.subscribe(f"{PREFIX}/drone1/pose")
                    for _ in range(10):
                        for key in (f"{OPERATOR_KEY}/mavlink", f"{STEP_KEY}/plant", f"{DIVERGED_KEY}/plant"):
                            bus.publisher(f"{PREFIX}/{key}")(b"hello", 0)
                            bus._session.put(f"{PREFIX}/{key}", b"hello")
                        time.sleep(0.02)
                    received = pose.get(timeout=2.0)
            except BusError:  # nothing listens yet
                time.sleep(0.1)
        output = run.communicate(timeout=200)[0]
        assert run.returncode == 0, output
    return received, output


def command(tmp_path, endpoint, *more):
    sets = ["--set", "run.duration=4", "--key-prefix", PREFIX, "--log", str(tmp_path / "log.mcap")]
    return [sys.executable, "-m", "lapwing", "run", "hover", "--speed", "2", "--listen", endpoint, *sets, *more]


def test_viewer_is_read_only_and_authenticated(tmp_path):
    (tcp,) = loopback_endpoints(["endpoint"]).values()
    endpoint, keys, foreign = tcp.replace("tcp/", "tls/"), tmp_path / "keys", tmp_path / "foreign"
    make(keys, [ROUTER, VIEWER], 1)
    make(foreign, [VIEWER], 1)
    security = tls(keys, VIEWER)
    received, output = visit(command(tmp_path, endpoint, "--keys", str(keys)), endpoint, security=security)
    assert PoseStamped.decode(received[1]).pose.position.z > 0.3
    assert "rejected" not in output  # the router accepts no messages

    with ZenohBus([endpoint], security=tls(keys, ROUTER)):
        authority = {"root_ca_certificate": security["transport/link/tls"]["root_ca_certificate"]}
        nothing = {"transport/link/tls": {**authority, "verify_name_on_connect": False}}
        for stranger in (tls(foreign, VIEWER), nothing, {}):
            with pytest.raises(BusError):
                ZenohBus(connect=[endpoint], mode="client", security=stranger)
        ZenohBus(connect=[endpoint], mode="client", security=security).close()


def test_endpoint_without_certificates_is_read_only(tmp_path):
    (endpoint,) = loopback_endpoints(["endpoint"]).values()
    received, output = visit(command(tmp_path, endpoint, "--insecure"), endpoint)
    assert PoseStamped.decode(received[1]).pose.position.z > 0.3
    assert "rejected" not in output


def test_client_without_certificate_gets_no_lock_step():
    ends = loopback_endpoints(["plant", ROUTER, "endpoint"])
    peers = {name: ends[name] for name in ("plant", ROUTER)}
    security = settings(resolve(load("hover")), ROUTER, PREFIX, "")
    listen, connect = mesh(ROUTER, peers)
    with (
        ZenohBus(*mesh("plant", peers)) as plant,
        ZenohBus([*listen, ends["endpoint"]], connect, "router", security=security),
        ZenohBus(connect=[ends["endpoint"]], mode="client") as viewer,
    ):
        arrived = viewer.subscribe(f"{PREFIX}/**")
        pose, batch = (plant.publisher(f"{PREFIX}/{key}") for key in ("drone1/pose", f"{BATCH_KEY}/plant"))
        keys: list[str] = []
        while keys.count(f"{PREFIX}/drone1/pose") < 10:
            batch(b"batch", 0)
            pose(b"pose", 0)
            keys += [message[0] for message in [arrived.get_with_key(timeout=0.1)] if message]
        assert set(keys) == {f"{PREFIX}/drone1/pose"}


def test_stalled_viewer_does_not_block_run(tmp_path):
    (endpoint,) = loopback_endpoints(["endpoint"]).values()
    words = command(tmp_path, endpoint, "--insecure", "--set", "run.duration=12")
    released, keys = threading.Event(), set()
    with subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True) as run:
        viewer = None
        while viewer is None and run.poll() is None:
            try:
                viewer = ZenohBus(connect=[endpoint], mode="client")
            except BusError:  # nothing listens yet
                time.sleep(0.1)
        arrived = viewer.subscribe(f"{PREFIX}/**")
        while f"{PREFIX}/drone1/pose" not in keys and run.poll() is None:
            keys |= {message[0] for _ in range(50) if (message := arrived.get_with_key(timeout=0.1))}
        # a client that blocks Zenoh's only thread and stops reading
        frozen = zenoh.handlers.Callback(lambda sample: released.wait(), indirect=False)
        viewer._declared.append(viewer._session.declare_subscriber(f"{PREFIX}/**", frozen))
        output = run.communicate(timeout=200)[0]
        released.set()
        viewer.close()
    assert run.returncode == 0, output
    assert f"{PREFIX}/drone1/pose" in keys, output
    assert not [key for key in keys if key.startswith(f"{PREFIX}/_")]  # senders of these keys wait for all subscribers
