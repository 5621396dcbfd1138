"""Commands and Python blocks of the README and of the page of commands by task run as written."""

import os
import re
import shlex
from concurrent.futures import Future, ThreadPoolExecutor
from itertools import pairwise
from pathlib import Path

import pytest

from lapwing.views.view3d import headless
from tests.combinations import NIGHTLY
from tests.commands import run_command

pytestmark = pytest.mark.long

ROOT = Path(__file__).parent.parent
README = (ROOT / "README.md").read_text()
PAGES = README + (ROOT / "docs/guides/cookbook.md").read_text()
COMMANDS = [
    line.partition(" #")[0].strip()
    for block in re.findall(r"```sh\n(.*?)```", PAGES, flags=re.DOTALL)
    for line in block.splitlines()
]
FLOWN = [c for c in COMMANDS if c.startswith("lapwing ")]
STUDIES = ("check hover --accuracy", "effects ", "tune ", "campaign ")  # test_options.py runs them on smaller scenes


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Return a folder with the scenes and the recordings folder of a checkout."""
    path = tmp_path_factory.mktemp("checkout")
    (path / "lapwing").mkdir()
    (path / "lapwing/scenes").symlink_to(ROOT / "lapwing/scenes")
    (path / "recordings").mkdir()
    return path


@pytest.fixture(scope="module")
def begun(folder, request):
    """Run the selected commands, one per core at a time; yield the future result of each."""
    names = {item.callspec.params["command"] for item in request.session.items if _is_flown(item)}
    result: dict[str, Future] = {}
    pool = ThreadPoolExecutor(os.cpu_count())
    for number, command in enumerate(c for c in FLOWN if c in names):
        before = [result[c] for c in result if _written(c) & set(shlex.split(command))]
        result[command] = pool.submit(_run, command, f"test-readme-{number}", folder, before)
    yield result
    pool.shutdown(cancel_futures=True)


def _is_flown(item):
    return item.module.__name__ == __name__ and "begun" in item.fixturenames


def _written(command):
    """Return the logs that a command writes."""
    words = shlex.split(command)
    return {log for option, log in pairwise(words) if option == "--log"}


def _run(command, key_prefix, folder, before):
    """Run a command after the commands that write its input.

    Videos have one picture per second instead of twenty, and one effect is studied instead of all: the others test the
    same code, and each would compile a plant of its own.
    """
    for one in before:
        one.result()
    words = shlex.split(command)[1:]
    own = ["--key-prefix", key_prefix]
    more = {"run": own, "replay": own, "render": ["--fps", "1"], "effects": ["--only", "air_density"]}.get(words[0], [])
    return run_command(*words, *more, folder=folder)


@pytest.mark.parametrize(
    "command", [pytest.param(c, marks=NIGHTLY) if c.removeprefix("lapwing ").startswith(STUDIES) else c for c in FLOWN]
)
def test_readme_command_runs(command, begun):
    done = begun[command].result()
    if done.returncode == 2 and "no headless browser" in done.stderr and headless.PROGRAM is None:
        pytest.skip("needs Chromium")
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.parametrize("command", [c for c in COMMANDS if c.startswith("make ")])
def test_readme_make_target_exists(command):
    target = command.split()[1]
    assert re.search(rf"^{target}:", (ROOT / "Makefile").read_text(), flags=re.MULTILINE)


@pytest.mark.parametrize("command", [c for c in COMMANDS if c.startswith("docker compose ")])
def test_readme_compose_service_exists(command):
    service = command.split()[-1]
    assert re.search(rf"^  {service}:$", (ROOT / "docker-compose.yml").read_text(), flags=re.MULTILINE)


def test_readme_python_blocks_run(folder, monkeypatch):
    monkeypatch.chdir(folder)
    blocks = re.findall(r"```python\n(.*?)```", PAGES, flags=re.DOTALL)
    assert blocks
    names: dict = {}
    for block in blocks:
        exec(compile(block, "README.md", "exec"), names)
    assert (folder / "flight.html").stat().st_size > 10_000


def test_readme_links_resolve():
    for target, anchor in re.findall(r"\]\(([^)#]+)#?([^)]*)\)", README):
        assert (ROOT / target).exists(), target
        if anchor:
            headings = re.findall(r"^#+ (.*)$", (ROOT / target).read_text(), re.MULTILINE)
            assert anchor in {heading.lower().replace(" ", "-") for heading in headings}, (target, anchor)


def test_readme_is_short():
    assert len(README.splitlines()) <= 80
