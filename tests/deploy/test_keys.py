"""Certificates of containers (deploy/keys.sh) without Docker: kept while valid, otherwise all renewed."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from lapwing.cosim.access.certificates import make

SCRIPT = Path(__file__).parents[2] / "deploy" / "keys.sh"
NAMES = ("mission", "plant", "viewer")
FILES = {"authority.pem", "certificate.pem", "key.pem", "zenoh.json5"}

pytestmark = [
    pytest.mark.long,
    pytest.mark.skipif(not shutil.which("cmp"), reason="needs diffutils, which the image has"),
]


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
