"""docker-compose.yml without Docker: the file is valid, and its commands fly a vehicle and a campaign here."""

import math
import re
import socket
import struct
import subprocess
import sys
import time
from contextlib import contextmanager
from itertools import pairwise
from pathlib import Path

import pytest
from pymavlink import mavutil

from lapwing.cosim.access.certificates import make
from lapwing.cosim.access.zenoh_access import VIEWER
from lapwing.cosim.processes.run_monitor import MONITOR
from lapwing.runs.distributed_run import parse_endpoints
from lapwing.services import process_table as processes
from lapwing.services import security
from lapwing.services.common.firmware.schema import FIRMWARES
from lapwing.services.scene_resolver import load, resolve
from tests.commands import run_command
from tests.services.foxglove.client import patient

pytestmark = pytest.mark.long

yaml = pytest.importorskip("yaml", reason="PyYAML is not installed")

ROOT = Path(__file__).parent.parent
PATIENCE = 600.0  # [s] for processes that start, compile and end on a busy machine
SET = {"SCENE": "lapwing/scenes/groundstation.toml", "SPEED": "2"}


def compose(**inputs):
    """Return the services of the file with its variables substituted."""
    text = (ROOT / "docker-compose.yml").read_text()
    text = re.sub(r"\$\{(\w+):-([^}]*)\}", lambda m: (SET | inputs).get(m[1], m[2]), text)
    return yaml.safe_load(text)["services"]


@contextmanager
def ended():
    """Yield a list; terminate the processes in it at the end."""
    running = []
    try:
        yield running
    finally:
        for process in running:
            process.terminate()
        for process in running:
            process.wait(PATIENCE)


def free_port(kind=socket.SOCK_STREAM):
    with socket.socket(socket.AF_INET, kind) as s:
        s.bind(("127.0.0.1", 0))
        return s.getsockname()[1]


def test_compose_services_have_known_commands():
    services = compose()
    for name, service in services.items():
        assert set(service.get("depends_on", ())) <= set(services), name
        if command := service.get("command"):
            if entrypoint := service.get("entrypoint"):
                assert (ROOT / "deploy" / entrypoint[0]).exists()
                continue
            assert command[0] == "lapwing" or command[:2] == ["python", "-m"]
            assert command[1] in ("run", "service", "replay", "campaign", "-m")


def test_profile_starts_exactly_its_dependencies():
    services = compose()
    assert "profiles" not in services.pop("keys")  # otherwise docker-compose 1.29 does not find it
    for name, service in services.items():
        assert service["profiles"], name  # a service without profiles starts with every profile
        for needed in {*service.get("depends_on", ())} - {"keys"}:
            assert set(service["profiles"]) <= set(services[needed]["profiles"]), f"{name} needs {needed}"
    profiles = ("cluster", "mission", "groundstation", "view")
    of = {p: {n for n, s in services.items() if p in s["profiles"]} for p in profiles}
    for firmware in FIRMWARES:
        assert {n for n, s in services.items() if firmware in s["profiles"]} == {firmware}
    assert of["cluster"] == {"scheduler", "worker", "campaign"}
    assert of["mission"] | {"keys"} == {"mission", *services["mission"]["depends_on"]}
    assert of["groundstation"] == {*of["mission"], "groundstation"}
    assert of["view"] == {*of["mission"], "foxglove"}


def test_every_image_is_stage_of_dockerfile():
    stages = set(re.findall(r"^FROM \S+ AS (\S+)$", (ROOT / "Dockerfile").read_text(), re.MULTILINE))
    images = {(service["image"], service["build"]["target"]) for service in compose().values()}
    assert {target for _, target in images} <= stages
    assert images == {("lapwing" if t == "runtime" else f"lapwing-{t}", t) for _, t in images}


def own_certificates(services):
    """Return the participant whose certificate each service of a flight needs, by service."""
    taking_part = {
        name: service["command"] for name, service in services.items() if "--endpoints" in service["command"]
    }
    return {name: command[2] if command[1] == "service" else name for name, command in taking_part.items()}


def mounted(service):
    """Return source and target of each service's certificates."""
    return [volume for volume in service.get("volumes", ()) if "keys" in volume]


def test_container_gets_only_its_own_certificate():
    services = compose()
    services.pop("tests")
    keys, own = services.pop("keys"), own_certificates(services)
    for name, service in services.items():
        expected = [f"keys-{own[name]}:/app/keys/{own[name]}:ro"] if name in own else []
        assert mounted(service) == expected, name
        made = service.get("depends_on", {})
        assert (name in own) == ("keys" in made), name
        assert name not in own or made["keys"] == {"condition": "service_completed_successfully"}
    assert sorted(mounted(keys)) == sorted(f"keys-{each}:/app/keys/{each}" for each in (*own.values(), VIEWER))
    assert keys["network_mode"] == "none"
    assert set(keys["command"]) == {own[name] for name in own if services[name].get("user") == "root"}
    declared = yaml.safe_load((ROOT / "docker-compose.yml").read_text())["volumes"]
    assert set(declared) == {volume.partition(":")[0] for volume in mounted(keys)}


def test_container_links_are_certified_by_default():
    services, opened = compose(), compose(SCHEME="tcp", LINKS="--insecure")
    for name in own_certificates({name: each for name, each in services.items() if "command" in each}):
        command, insecure = services[name]["command"], opened[name]["command"]
        k = command.index("--endpoints") + 1
        assert command[k + 1] == "--keys=keys"
        assert {endpoint.partition("/")[0] for endpoint in parse_endpoints(command[k]).values()} == {"tls"}
        # only this host can reach the ports of MAVLink and Foxglove
        assert ("--insecure" in command) == (name in ("groundstation", "foxglove"))
        if "--listen" in command:
            assert command[command.index("--listen") + 1].startswith("tls/")
        assert insecure[k + 1] == "--insecure"
        assert {endpoint.partition("/")[0] for endpoint in parse_endpoints(insecure[k]).values()} == {"tcp"}


def test_containers_have_least_privileges():
    for name, service in compose().items():
        assert service["cap_drop"] == ["ALL"], name
        assert service["security_opt"] == ["no-new-privileges:true"], name
        assert all(port.startswith("127.0.0.1:") for port in service.get("ports", ())), name
        assert "privileged" not in service, name
        assert service.get("network_mode", "none") == "none", name
        assert service["read_only"], name
        assert {"mem_limit", "pids_limit", "healthcheck"} <= {*service}, name
        # a container that starts as root may change its user or give files to others (deploy/entrypoint.sh, keys.sh)
        added = ["SETGID", "SETPCAP", "SETUID"] if name in ("mission", "recorder", "campaign", *FIRMWARES) else []
        added = ["CHOWN"] if name == "keys" else added
        assert service.get("cap_add", []) == added, name
        assert ("user" in service) == bool(added), name


def endpoints():
    """Return the endpoints of the participants, and the services that `docker compose up mission` starts."""
    mission = compose()["mission"]
    table = mission["command"][mission["command"].index("--endpoints") + 1]
    return parse_endpoints(table), {"mission", *mission["depends_on"]} - {"keys"}


@pytest.mark.parametrize("scene", sorted((ROOT / "lapwing/scenes").glob("*.toml")), ids=lambda path: path.stem)
def test_required_processes_have_container_and_endpoint(scene):
    config = resolve(load(scene))
    if processes.foreign_firmware(config):
        pytest.skip("flies in one container: its profile")
    peers, started = endpoints()
    needed = {MONITOR, *processes.required_processes(config)}
    assert needed <= set(peers)
    assert needed <= started


def test_every_process_has_endpoint():
    peers, _ = endpoints()
    one_container = {processes.FMU, *FIRMWARES}  # foreign code is flown inside one container
    assert {entry.name for entry in processes.PROCESSES} - one_container <= set(peers)


@pytest.mark.nightly
def test_cluster_flies_campaign(tmp_path):
    pytest.importorskip("distributed", reason="Dask is not installed: pip install lapwing[cluster]")
    services, port = compose(), str(free_port())

    def start(name, *more):
        words = [word.replace("scheduler:8786", f"127.0.0.1:{port}") for word in services[name]["command"]]
        words = [port if word == "8786" else word.replace("recordings/", f"{tmp_path}/") for word in words]
        other = {"/tmp": str(tmp_path), SET["SCENE"]: "lapwing/scenes/hover.toml"}
        words = [other.get(word, word) for word in words]
        program = [sys.executable, *words[1:]] if words[0] == "python" else [sys.executable, "-m", *words]
        with (tmp_path / f"{name}.txt").open("w") as output:
            return subprocess.Popen([*program, *more], cwd=ROOT, stdout=output, stderr=subprocess.STDOUT)

    with ended() as helpers:
        helpers.append(start("scheduler"))
        helpers.append(start("worker"))
        flights = start("campaign", "--set", "run.duration=1", "--runs", "4")
        assert flights.wait(PATIENCE) == 0, (tmp_path / "campaign.txt").read_text()
        assert "4 runs" in (tmp_path / "campaign.txt").read_text()
        assert (tmp_path / "campaign" / "report.html").exists()
        assert "Register worker" in (tmp_path / "scheduler.txt").read_text()


@contextmanager
def flying(services, name, folder, *more):
    """Yield the processes of the containers that `name` needs, and the local ports; append `more` to each command."""
    ports = {}

    def here(word):
        """Replace the addresses of containers by local ones."""
        kind = socket.SOCK_DGRAM if word.startswith("udp") else socket.SOCK_STREAM
        addresses = r"(?<=/)[a-z0-9]+:7447|0\.0\.0\.0:\d+"
        word = re.sub(addresses, lambda m: f"127.0.0.1:{ports.setdefault(m[0], free_port(kind))}", word)
        return word.replace("recordings/", f"{folder}/")

    running = {}
    with ended() as processes:
        for each in [*({*services[name]["depends_on"]} - {"keys"}), name]:
            command = [sys.executable, "-m", "lapwing", *map(here, services[each]["command"][1:]), *more]
            with (folder / f"{each}.txt").open("w") as output:
                running[each] = subprocess.Popen(command, cwd=ROOT, stdout=output, stderr=subprocess.STDOUT)
            processes.append(running[each])
        yield running, ports


def test_viewer_with_certificate_receives_flight_and_events(tmp_path):
    pytest.importorskip("foxglove", reason="needs the extra `foxglove`")
    keys = tmp_path / "keys"
    make(keys, security.names(), 1)
    services = compose(SCENE="lapwing/scenes/hover.toml", SPEED="1", LINKS=f"--keys={keys}")
    with flying(services, "foxglove", tmp_path, "--set", "run.duration=6") as (running, ports):
        client = patient(ports["0.0.0.0:8765"], running["foxglove"])
        client.subscribe("/drone1/ground_truth", "/drone1/events")
        seen = {0: 0, 1: 0}  # messages by subscription
        while (message := client.next()) is not None:
            if isinstance(message, bytes) and message[0] == 1:
                seen[struct.unpack_from("<I", message, 1)[0]] += 1
        ends = {name: process.wait(PATIENCE) for name, process in running.items()}
    assert ends == dict.fromkeys(ends, 0), {name: (tmp_path / f"{name}.txt").read_text() for name in ends}
    assert seen[0] > 100
    assert seen[1] > 0


@pytest.mark.nightly
def test_groundstation_services_fly_as_separate_processes(tmp_path):
    services = compose(SCHEME="tcp", LINKS="--insecure")
    with flying(services, "groundstation", tmp_path) as (running, ports):
        port = ports["0.0.0.0:5760"]
        station = None
        while station is None and running["groundstation"].poll() is None:
            try:
                station = mavutil.mavlink_connection(f"tcp:127.0.0.1:{port}", retries=1)
            except OSError:
                time.sleep(0.5)
        assert station, (tmp_path / "groundstation.txt").read_text()

        def order(number, *params):
            station.mav.heartbeat_send(6, 8, 0, 0, 0)
            station.mav.command_long_send(1, 1, number, 0, *params, *[math.nan] * (7 - len(params)))
            while (ack := station.recv_match(type="COMMAND_ACK", blocking=True, timeout=PATIENCE)).command != number:
                pass
            return ack.result

        assert station.recv_match(type="HEARTBEAT", blocking=True, timeout=PATIENCE)
        ready = mavutil.mavlink.MAV_SYS_STATUS_PREARM_CHECK
        health = 0
        while not health & ready:
            status = station.recv_match(type="SYS_STATUS", blocking=True, timeout=PATIENCE)
            health = status.onboard_control_sensors_health
        assert order(400, 1.0, 0.0) == 0
        assert order(22) == 0
        while station.recv_match(type="GLOBAL_POSITION_INT", blocking=True, timeout=PATIENCE).relative_alt < 1500:
            pass
        station.close()
        assert "not part of" in (tmp_path / "trajectory.txt").read_text()


@pytest.mark.parametrize("firmware", FIRMWARES)
def test_firmware_profile_starts_mounted_program(firmware):
    service = compose(SCENE=f"{firmware}_quad")[firmware]
    mount = next(v for v in service["volumes"] if ":/opt/" in v)
    host, target, mode = mount.split(":")
    assert (host[:2], mode) == ("./", "ro")
    overrides = [value for option, value in pairwise(service["command"]) if option == "--set"]
    config = resolve(load(service["command"][2], overrides)).services[firmware].parameters
    assert config.command[0].startswith(target)
    assert service["healthcheck"] == {"disable": True}


@pytest.mark.parametrize(
    ("firmware", "program", "skipped", "ends"),
    [("px4", "bin/px4", 2, "Landed"), ("ardupilot", "arducopter", 0, "leaves the ground")],
)
def test_firmware_profile_flies_mounted_program(firmware, program, skipped, ends, tmp_path):
    peer = ROOT / f"tests/services/{firmware}/scripted_{firmware}.py"
    file = tmp_path / program
    file.parent.mkdir(exist_ok=True)
    file.write_text(f'#!/bin/sh\nshift {skipped}\nexec "{sys.executable}" "{peer}" "$@"\n')
    file.chmod(0o755)
    service = compose(SCENE=f"{firmware}_quad", LOG=str(tmp_path / "flight.mcap"))[firmware]
    command = [part.replace(f"/opt/{firmware}", str(tmp_path)) for part in service["command"][1:]]
    short = ["--set", "run.duration=15.0"] if firmware == "ardupilot" else []
    done = run_command(*command, *short)
    assert ends in done.stdout, done.stdout + done.stderr
