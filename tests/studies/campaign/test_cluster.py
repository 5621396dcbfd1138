"""Campaign on a Dask cluster: killed and late workers, lost scheduler."""

import os
import signal
import socket
import subprocess
import sys

import pytest

from lapwing.cosim.run_errors import RunFailed
from lapwing.studies import workers
from lapwing.studies.campaign.folder import begin, manifest
from lapwing.studies.campaign.plan import plan
from lapwing.studies.campaign.runs import first_config, reference
from lapwing.studies.campaign.shard_loop import campaign
from lapwing.studies.workers import dask

pytestmark = pytest.mark.long

distributed = pytest.importorskip("distributed", reason="Dask is not installed: pip install lapwing[cluster]")


def test_killed_and_late_workers_do_not_change_results(tmp_path):
    new_plan = plan("delivery_mission", ("run.duration=3.5",), runs=40, seed=7)
    first = reference(*first_config(new_plan))
    local, folder = (begin(tmp_path / name, new_plan, manifest(new_plan, first)) for name in ("alone", "cluster"))
    campaign(local, first, workers.run_here)
    with (
        distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster,
        distributed.Client(cluster, set_as_default=False) as client,
    ):
        victim, *_ = client.run(os.getpid).values()
        calls = []

        def kill_worker(count):
            calls.append(count.runs)
            if len(calls) == 2:  # after the first shard
                cluster.scale(3)
                os.kill(victim, signal.SIGKILL)

        count = campaign(folder, first, dask(cluster.scheduler_address), kill_worker)
    assert count.runs == 40
    assert len(calls) == 1 + len(folder.shards)
    assert folder.finish() == local.finish()


def test_lost_scheduler_is_one_line_and_keeps_runs(tmp_path, capfd):
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        address = f"tcp://127.0.0.1:{free.getsockname()[1]}"
    common = ["--no-dashboard"]
    scheduler = ["dask_scheduler", "--host", address, *common]
    worker = ["dask_worker", address, "--nthreads", "1", "--local-directory", str(tmp_path), *common]
    new_plan = plan("delivery_mission", ("run.duration=3.5",), runs=400, seed=7)
    first = reference(*first_config(new_plan))
    folder = begin(tmp_path / "folder", new_plan, manifest(new_plan, first))
    with (tmp_path / "output").open("w") as output:
        helpers = [
            subprocess.Popen(
                [sys.executable, "-m", f"distributed.cli.{name}", *arguments], stdout=output, stderr=output
            )
            for name, *arguments in (scheduler, worker)
        ]
        try:
            with pytest.raises(RunFailed, match=f"the scheduler at {address} is lost; repeat the command to continue"):
                campaign(folder, first, dask(address), lambda count: helpers[0].kill() if count.runs else None)
        finally:
            for helper in helpers:
                helper.kill()
                helper.wait(timeout=60)
    assert 0 < len(folder.missing()) < len(folder.shards)
    assert "Traceback" not in capfd.readouterr().err


def test_missing_scheduler_is_reported(monkeypatch):
    monkeypatch.setattr("lapwing.studies.workers.SCHEDULER_TIMEOUT", 0.5)
    with pytest.raises(ValueError, match=r"--cluster tcp://127.0.0.1:9: no Dask scheduler answers"):
        dask("tcp://127.0.0.1:9")
