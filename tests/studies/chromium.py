"""A page in headless Chromium, spoken to over a pipe in the browser's own protocol: no driver is needed."""

import json
import os
import shutil
import subprocess
from pathlib import Path

PROGRAM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
# Its own pipe is at descriptors 3 and 4.
START = 'exec "$0" --headless=new --no-sandbox --disable-dev-shm-usage --use-angle=swiftshader \
--enable-unsafe-swiftshader --remote-debugging-pipe --user-data-dir="$1" about:blank 3<&{reading} 4>&{writing}'


class Browser:
    """A context manager; `errors` are the exceptions and error lines of the page's console."""

    def __init__(self, page: Path | str, profile: Path):
        self.errors: list[str] = []
        self._page, self._profile, self._number, self._rest = page, profile, 0, b""

    def __enter__(self):
        reading, self._to = os.pipe()
        self._from, writing = os.pipe()
        command = ["bash", "-c", START.format(reading=reading, writing=writing), PROGRAM, str(self._profile)]
        self._process = subprocess.Popen(command, pass_fds=(reading, writing), stderr=subprocess.DEVNULL)
        os.close(reading)
        os.close(writing)
        self._session = None
        target = self._call("Target.createTarget", url="about:blank")["targetId"]
        self._session = self._call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        for domain in ("Page", "Runtime", "Log"):
            self._call(f"{domain}.enable")
        self._call("Page.navigate", url=self._page if isinstance(self._page, str) else self._page.as_uri())
        return self

    def __exit__(self, *_):
        self._process.terminate()
        self._process.wait()
        os.close(self._to)
        os.close(self._from)

    def run(self, body: str):
        """Run the body of an asynchronous function in the page and return its result."""
        given = {"expression": f"(async () => {{{body}}})()", "awaitPromise": True, "returnByValue": True}
        found = self._call("Runtime.evaluate", **given)
        assert "exceptionDetails" not in found, found
        return found["result"].get("value")

    def _call(self, method, **parameters):
        self._number += 1
        message = {"id": self._number, "method": method, "params": parameters}
        if self._session:
            message["sessionId"] = self._session
        os.write(self._to, json.dumps(message).encode() + b"\0")
        while True:
            answer = self._next()
            if answer.get("id") == self._number:
                assert "error" not in answer, answer
                return answer["result"]
            self._note(answer)

    def _next(self):
        while b"\0" not in self._rest:
            part = os.read(self._from, 1 << 16)
            assert part, "the browser has ended"
            self._rest += part
        text, self._rest = self._rest.split(b"\0", 1)
        return json.loads(text)

    def _note(self, event):
        method, said = event.get("method"), event.get("params", {})
        if method == "Runtime.exceptionThrown":
            self.errors.append(str(said["exceptionDetails"]))
        elif method == "Log.entryAdded" and said["entry"]["level"] == "error":
            self.errors.append(said["entry"]["text"])
        elif method == "Runtime.consoleAPICalled" and said["type"] == "error":
            self.errors.append(str(said["args"]))
