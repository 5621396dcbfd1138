"""What the README tells its reader to type works as written."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
README = (ROOT / "README.md").read_text()
COMMANDS = [
    line.partition(" #")[0].strip()
    for block in re.findall(r"```sh\n(.*?)```", README, flags=re.DOTALL)
    for line in block.splitlines()
]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder that looks like a checkout to its user."""
    path = tmp_path_factory.mktemp("checkout")
    (path / "scenes").symlink_to(ROOT / "scenes")
    (path / "recordings").mkdir()
    return path


@pytest.mark.parametrize("command", [c for c in COMMANDS if c.startswith("lapwing ")])
def test_lapwing_commands_run_as_written(command, folder):
    words = command.split()[1:]
    more = ["--key-prefix", "test-readme"] if words[0] in ("run", "replay") else []
    subprocess.run([sys.executable, "-m", "lapwing", *words, *more], cwd=folder, check=True, timeout=900)


@pytest.mark.parametrize("command", [c for c in COMMANDS if c.startswith("make ")])
def test_make_targets_exist(command):
    target = command.split()[1]
    assert re.search(rf"^{target}:", (ROOT / "Makefile").read_text(), flags=re.MULTILINE)


@pytest.mark.parametrize("command", [c for c in COMMANDS if c.startswith("docker compose ")])
def test_compose_services_exist(command):
    service = command.split()[-1]
    assert re.search(rf"^  {service}:$", (ROOT / "docker-compose.yml").read_text(), flags=re.MULTILINE)


def test_the_python_blocks_run_in_order(folder, monkeypatch):
    monkeypatch.chdir(folder)
    blocks = re.findall(r"```python\n(.*?)```", README, flags=re.DOTALL)
    assert blocks
    names: dict = {}
    for block in blocks:
        exec(compile(block, "README.md", "exec"), names)
    assert (folder / "flight.html").stat().st_size > 10_000


def test_links_and_pictures_lead_somewhere():
    for target in re.findall(r"\]\(([^)]+)\)", README):
        assert (ROOT / target).exists(), target
