"""A client outside the run hears it through the router."""

import subprocess
import sys
import time

from cosim.bus import BusError, ZenohBus
from cosim.launcher import loopback_endpoints
from messages import PoseStamped


def test_a_client_hears_the_run(tmp_path):
    (door,) = loopback_endpoints(["door"]).values()
    command = [sys.executable, "-m", "lapwing", "run", "scenes/hover.toml", "--speed", "2", "--open", door]
    command += ["--set", "run.duration=4", "--key-prefix", "test-router", "--log", str(tmp_path / "log.mcap")]
    with subprocess.Popen(command, stdout=subprocess.DEVNULL) as run:
        heard = None
        while heard is None and run.poll() is None:
            try:
                with ZenohBus(connect=[door], mode="client") as bus:
                    heard = bus.subscribe("test-router/drone1/pose").get(timeout=2.0)
            except BusError:  # nobody listens yet
                time.sleep(0.1)
        assert run.wait(timeout=200) == 0
    assert PoseStamped.decode(heard[1]).pose.position.z > 0.3
