"""Files for two hosts: valid, complete, with the privileges of containers on one host."""

import re
from pathlib import Path

import pytest

from lapwing.cosim.processes.run_monitor import MONITOR
from lapwing.runs.distributed_run import parse_endpoints
from lapwing.services import process_table
from lapwing.services.scene_resolver import load, resolve

ROOT = Path(__file__).parents[2]
SET = {"DYNAMICS": "10.0.0.1", "FLIGHT": "10.0.0.2"}


def composed(name):
    """Return the services of a compose file with its variables substituted."""
    yaml = pytest.importorskip("yaml", reason="PyYAML is not installed")
    text = (ROOT / "deploy" / "hosts" / name).read_text()
    text = re.sub(r"\$\{(\w+)(?::-([^}]*))?\}", lambda m: SET.get(m[1], m[2]), text)
    return yaml.safe_load(text)["services"]


def peers_of(command):
    return parse_endpoints(command[command.index("--endpoints") + 1])


def test_two_hosts_share_endpoints_and_run_each_service_once():
    plant, others = composed("dynamics.yml"), composed("flight.yml")
    tables = [peers_of(service["command"]) for service in (plant | others).values()]
    assert all(table == tables[0] for table in tables)
    assert len(set(tables[0].values())) == len(tables[0])
    assert set(tables[0]) == {*plant, *others}
    assert not {*plant} & {*others}
    for scene in (ROOT / "lapwing/scenes").glob("*.toml"):
        config = resolve(load(scene))
        if not process_table.foreign_firmware(config):  # a foreign firmware runs on its own host
            assert {MONITOR, *process_table.required_processes(config)} <= set(tables[0])


def test_service_of_two_hosts_has_certificate_of_its_name():
    for address, services in (("10.0.0.1", composed("dynamics.yml")), ("10.0.0.2", composed("flight.yml"))):
        for name, service in services.items():
            assert service["command"][2] == name or name == MONITOR
            assert peers_of(service["command"])[name].startswith(f"tls/{address}:")
            assert f"../../keys/{name}:/app/keys/{name}:ro" in service["volumes"]
            assert service["read_only"]
            assert {"mem_limit", "pids_limit"} <= {*service}
            assert (service["cap_drop"], service["security_opt"]) == (["ALL"], ["no-new-privileges:true"])
            port = peers_of(service["command"])[name].rpartition(":")[2]
            assert service["healthcheck"]["test"][-1] == f": < /dev/tcp/{address}/{port}"
