"""Deployment: hosts, keys, jobs of campaigns, shipped files."""

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from lapwing.cosim.access.certificates import make
from lapwing.cosim.processes.run_monitor import MONITOR
from lapwing.runs.distributed_run import parse_endpoints
from lapwing.services import process_table
from lapwing.services.scene_resolver import load, resolve

DEPLOY = Path(__file__).parents[2] / "deploy"
RECORDER = f"""#!{sys.executable}
import json, os, sys
with open(os.environ["SAID"], "a") as said:
    print(json.dumps(sys.argv), file=said)
"""
WORDS = [
    "hover", "--runs", "8", "--set", 'success.require=["outcome == \'landed\'", "rmse.z < 0.1"]', "--vary", "a b=$c",
]  # fmt: skip


def calls(folder, *command, **environment):
    """Return the argv of each call of `lapwing` and `sbatch`, which are replaced by recorders."""
    output = folder / "said"
    output.unlink(missing_ok=True)
    for name in ("lapwing", "sbatch"):
        (folder / name).write_text(RECORDER + ('print("77")\n' if name == "sbatch" else ""))
        (folder / name).chmod(0o755)
    environment = {**os.environ, "PATH": f"{folder}:{os.environ['PATH']}", "SAID": str(output), **environment}
    subprocess.run(command, env=environment, check=True, cwd=folder, stdout=subprocess.DEVNULL)
    return [[Path(program).name, *words] for program, *words in map(json.loads, output.read_text().splitlines())]


def test_slurm_submits_parts_and_then_table(tmp_path):
    values = {"PARTS": "3", "DIR": str(tmp_path / "it's here")}
    array, last = calls(tmp_path, str(DEPLOY / "campaign.slurm"), *WORDS, **values)
    assert array[:4] == ["sbatch", "--parsable", "--export=ALL", "--array=1-3"]
    assert last[:4] == ["sbatch", "--export=ALL", "--dependency=afterany:77", "--wrap"]
    for part in (1, 2, 3):
        (flight,) = calls(tmp_path, *array[4:], **values, SLURM_ARRAY_TASK_ID=str(part))
        expected = ["--out", values["DIR"], "--shard", f"{part}/3", "--workers", "1"]
        assert flight == ["lapwing", "campaign", *WORDS, *expected]
    assert calls(tmp_path, "sh", "-c", last[4]) == [["lapwing", "campaign", *WORDS, "--out", values["DIR"]]]


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


SCRIPT = Path(__file__).parents[2] / "deploy" / "keys.sh"
NAMES = ("mission", "plant", "viewer")
FILES = {"authority.pem", "certificate.pem", "key.pem", "zenoh.json5"}


@pytest.fixture
def folder(tmp_path):
    """Return a container's folders for volumes, recordings and programs; `chown` records owners."""
    for name in NAMES:
        (tmp_path / "keys" / name).mkdir(parents=True)
    (tmp_path / "recordings").mkdir()
    programs = {"lapwing": f'exec {sys.executable} -m lapwing "$@"', "chown": f'echo "$@" >> {tmp_path}/given'}
    for name, does in programs.items():
        program = tmp_path / "bin" / name
        program.parent.mkdir(exist_ok=True)
        program.write_text(f"#!/bin/sh\n{does}\n")
        program.chmod(0o755)
    return tmp_path


def run(folder):
    path = f"{folder}/bin:{os.environ['PATH']}"
    command = ["sh", str(SCRIPT), "mission"]
    done = subprocess.run(command, cwd=folder, env=os.environ | {"PATH": path}, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stdout


def authorities(folder):
    return {(folder / "keys" / name / "authority.pem").read_text() for name in NAMES}


def test_each_participant_gets_only_its_own_key(folder):
    assert run(folder).startswith("certificates of mission, plant, viewer, until ")
    (trusted,) = authorities(folder)
    for name in NAMES:
        own = folder / "keys" / name
        assert {path.name for path in own.iterdir()} == FILES
        assert (own / "key.pem").stat().st_mode & 0o777 == 0o600
        command = ["openssl", "x509", "-noout", "-subject", "-in", str(own / "certificate.pem")]
        subject = subprocess.run(command, capture_output=True, text=True, check=True).stdout
        assert subject.rstrip().endswith(f"CN = {name}")
    assert "PRIVATE" not in trusted
    values = dict(reversed(line.split(maxsplit=1)) for line in (folder / "given").read_text().splitlines())
    owner = f"{(folder / 'recordings').stat().st_uid}:{(folder / 'recordings').stat().st_gid}"
    expected = {"mission": owner, "plant": "lapwing", "viewer": "lapwing"}
    assert values == {f"keys/{name}/key.pem keys/{name}/zenoh.json5": user for name, user in expected.items()}


def test_valid_certificates_are_kept(folder):
    run(folder)
    before = authorities(folder)
    run(folder)
    assert authorities(folder) == before


@pytest.mark.parametrize("lost", [*sorted(FILES), "expired", "of another authority"])
def test_invalid_certificates_are_all_renewed(folder, lost):
    run(folder)
    before = authorities(folder)
    if lost in FILES:
        (folder / "keys" / "plant" / lost).unlink()
    else:
        make(folder / "others", NAMES, 2 if lost == "expired" else 365)  # valid for less than a week
        for name in NAMES if lost == "expired" else ("plant",):
            shutil.copytree(folder / "others" / name, folder / "keys" / name, dirs_exist_ok=True)
        before |= authorities(folder)
    run(folder)
    assert len(authorities(folder)) == 1
    assert not authorities(folder) & before


@pytest.mark.skipif(not shutil.which("make"), reason="needs make")
@pytest.mark.parametrize("target", ["sbom", "audit"])
def test_every_lock_of_shipped_image_is_read(target):
    command = ["make", "--dry-run", "--no-print-directory", target]
    output = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout
    locks = {f"deploy/{path.name}" for path in (ROOT / "deploy").glob("requirements*.lock")}
    reads = next(
        line for line in reversed(output.splitlines()) if "--require-hashes" in line and "--requirement" in line
    )
    assert {word for word in reads.split() if word in locks} == locks - {"deploy/requirements-tests.lock"}
