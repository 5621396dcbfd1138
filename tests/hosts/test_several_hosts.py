"""Services on several hosts: equal digests over a bad network, and an error that names a lost host."""

import time

import pytest

from lapwing.cosim.access.certificates import make
from lapwing.cosim.log import LogReader
from lapwing.cosim.processes.run_monitor import MONITOR
from lapwing.runs.single_process_run import fly_single
from lapwing.services.scene_resolver import load, resolve
from tests.combinations import NIGHTLY
from tests.hosts.network import Network, why_not
from tests.hosts.run import Run

HOSTS = {
    "plant": "dynamics",
    "sensors": "flight",
    "autopilot": "flight",
    "trajectory": "flight",
    "recorder": "log",
    MONITOR: "log",
}

pytestmark = [pytest.mark.long, NIGHTLY]


@pytest.fixture(scope="module")
def keys(tmp_path_factory):
    if reason := why_not():
        pytest.skip(reason)
    folder = tmp_path_factory.mktemp("keys") / "keys"
    make(folder, HOSTS, 1)
    return folder


def test_digest_is_equal_over_slow_lossy_network(keys, tmp_path):
    short = "run.duration=0.4"
    fly_single(resolve(load("delivery_mission", [short])), tmp_path / "here.mcap")
    with (
        Network(sorted(set(HOSTS.values())), delay=(0.020, 0.025), loss=0.02) as network,
        Run(network, HOSTS, [short, "success.require=[]"], keys, tmp_path) as run,
    ):
        run.flies()
        network.cut_off = {"dynamics"}
        time.sleep(2.0)
        at = run.size()
        time.sleep(0.1)
        assert run.size() == at  # the run waits
        network.cut_off = set()
        ends = run.ends()
    assert ends == dict.fromkeys(HOSTS, (0, ""))
    with LogReader(run.log) as there, LogReader(tmp_path / "here.mcap") as here:
        assert there.digest() == here.digest()


def test_lost_host_is_named_and_run_ends(keys, tmp_path):
    with Network(sorted(set(HOSTS.values()))) as network, Run(network, HOSTS, [], keys, tmp_path) as run:
        run.flies()
        network.cut_off = {"flight"}
        ends = run.ends()
    output = {name: words for name, (_, words) in ends.items()}
    assert {name: code for name, (code, _) in ends.items()} == dict.fromkeys(ends, 1), output
    assert output.pop(MONITOR).startswith("lapwing: autopilot, sensors, trajectory: no answer for 6 s, at t = ")
    assert output == {name: f"lapwing: {name}: {MONITOR} left before the end of the run\n" for name in output}
    with LogReader(run.log) as read:
        assert list(read.messages())
