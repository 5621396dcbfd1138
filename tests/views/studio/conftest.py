"""Fixture of a running `lapwing studio` in a temporary folder."""

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

TIMEOUT = 300.0  # [s] generous, for a loaded machine
ROOT = Path(__file__).parents[3]


class NoRedirect(urllib.request.HTTPRedirectHandler):
    def redirect_request(self, *_):
        return None


class Studio:
    """Process of the command, with an HTTP client."""

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
        """Return status, text and headers of a response."""
        url = path if path.startswith("http") else self.address + path
        if isinstance(data, dict | list):
            data = urllib.parse.urlencode(data).encode()
            headers = {"Origin": self.origin, **headers}
        request = urllib.request.Request(url, data, {k.replace("_", "-"): v for k, v in headers.items()})
        try:
            with self._opener.open(request, timeout=TIMEOUT) as answer:
                return answer.status, answer.read().decode(), answer.headers
        except urllib.error.HTTPError as error:
            return error.code, error.read().decode(), error.headers

    def page(self, path):
        status, text, _ = self.request(path)
        assert status == 200, text
        return text

    def wait(self, number):
        """Return the page of a run after its end."""
        end = time.monotonic() + TIMEOUT
        while '"running":true' in self.page(f"runs/{number}/state"):
            assert time.monotonic() < end
            time.sleep(0.2)
        return self.page(f"runs/{number}")

    def stop(self):
        self.process.send_signal(signal.SIGINT)
        rest = self.process.stdout.read()
        return self.process.wait(TIMEOUT), rest


@pytest.fixture(scope="module")
def start():
    """Yield a function that starts a studio in a folder; end the studio after the tests of the file."""
    running = []

    def begin(folder, *options):
        running.append(Studio(folder, *options))
        return running[-1]

    yield begin
    for each in running:
        if each.process.poll() is None:
            each.stop()
