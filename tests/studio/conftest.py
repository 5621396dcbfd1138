"""A running `lapwing studio` in a folder of its own."""

import os
import re
import signal
import subprocess
import sys
import time
import urllib.error
import urllib.parse
import urllib.request
from pathlib import Path

import pytest

PATIENCE = 300.0  # [s] for what a loaded machine does in the end
ROOT = Path(__file__).parents[2]


class NoRedirect(urllib.request.HTTPRedirectHandler):
    def redirect_request(self, *_):
        return None


class Studio:
    """The command as a process, and an HTTP client."""

    def __init__(self, folder, *options):
        environment = os.environ | {"PYTHONPATH": str(ROOT), "BROWSER": "true", "PYTHONUNBUFFERED": "1"}
        command = [sys.executable, "-m", "lapwing", "studio", *options]
        self.process = subprocess.Popen(command, cwd=folder, env=environment, stdout=subprocess.PIPE, text=True)
        line = self.process.stdout.readline()
        self.address, self.origin, self.token = re.fullmatch(
            r"studio: ((http://127\.0\.0\.1:\d+)/([\w-]{22})/)\n", line
        ).groups()
        self._opener = urllib.request.build_opener(NoRedirect)

    def request(self, path, data=None, **headers):
        """Status, text and headers of an answer."""
        url = path if path.startswith("http") else self.address + path
        if isinstance(data, dict | list):
            data = urllib.parse.urlencode(data).encode()
            headers = {"Origin": self.origin, **headers}
        request = urllib.request.Request(url, data, {k.replace("_", "-"): v for k, v in headers.items()})
        try:
            with self._opener.open(request, timeout=PATIENCE) as answer:
                return answer.status, answer.read().decode(), answer.headers
        except urllib.error.HTTPError as error:
            return error.code, error.read().decode(), error.headers

    def page(self, path):
        status, text, _ = self.request(path)
        assert status == 200, text
        return text

    def wait(self, number):
        """The page of a run after its end."""
        end = time.monotonic() + PATIENCE
        while '"running":true' in self.page(f"runs/{number}/state"):
            assert time.monotonic() < end
            time.sleep(0.2)
        return self.page(f"runs/{number}")

    def stop(self):
        self.process.send_signal(signal.SIGINT)
        rest = self.process.stdout.read()
        return self.process.wait(PATIENCE), rest


@pytest.fixture(scope="module")
def start():
    """Starts a studio in a folder; ends it after the tests of the file."""
    running = []

    def begin(folder, *options):
        running.append(Studio(folder, *options))
        return running[-1]

    yield begin
    for each in running:
        if each.process.poll() is None:
            each.stop()
