"""A page in headless Chromium, controlled over a pipe by the DevTools protocol, without a driver."""

import base64
import json
import os
import shutil
import subprocess
import tempfile
from pathlib import Path
from typing import Any, Self

PROGRAMS = ("chromium", "chromium-browser", "google-chrome")
ENDED = "the headless browser has ended unexpectedly; try again with fewer programs running"
PROGRAM = next(filter(None, map(shutil.which, PROGRAMS)), None)
# OpenGL of the system, whose software renderer is twice as fast as that of the browser, the fallback.
# The DevTools pipe is at descriptors 3 and 4.
START = 'exec "$0" {flags} --headless=new --no-sandbox --disable-dev-shm-usage --use-angle=gl-egl \
--ignore-gpu-blocklist --enable-unsafe-swiftshader \
--remote-debugging-pipe --user-data-dir="$1" about:blank 3<&{reading} 4>&{writing}'


class BrowserError(ValueError):
    """Error of the browser: it has ended, or a script of its page has failed."""


class Browser:
    """Headless browser with one page, a context manager.

    Attributes:
        errors: exceptions and error lines of the page's console.
    """

    def __init__(self, page: Path | str, size: tuple[int, int] | None = None, flags: str = ""):
        """Create a browser.

        Args:
            page: path or address of the page.
            size: width and height of the window [pixel]; None: the default.
            flags: further options of the browser.
        """
        self.errors: list[str] = []
        self._page, self._size, self._flags = page, size, flags
        self._number, self._rest = 0, b""
        self._profile = tempfile.TemporaryDirectory(ignore_cleanup_errors=True)

    def __enter__(self) -> Self:
        if PROGRAM is None:
            raise ValueError(f"no headless browser: none of {', '.join(PROGRAMS)} is installed; install chromium")
        reading, self._to = os.pipe()
        self._from, writing = os.pipe()
        command = [
            "bash",
            "-c",
            START.format(flags=self._flags, reading=reading, writing=writing),
            PROGRAM,
            self._profile.name,
        ]
        self._process = subprocess.Popen(command, pass_fds=(reading, writing), stderr=subprocess.DEVNULL)
        os.close(reading)
        os.close(writing)
        self._session = None
        target = self.call("Target.createTarget", url="about:blank")["targetId"]
        self._session = self.call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        for domain in ("Page", "Runtime", "Log"):
            self.call(f"{domain}.enable")
        if self._size:
            width, height = self._size
            metrics = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": False}
            self.call("Emulation.setDeviceMetricsOverride", **metrics)
        self.call("Page.navigate", url=self._page if isinstance(self._page, str) else self._page.resolve().as_uri())
        return self

    def __exit__(self, *_: object) -> None:
        self._process.terminate()
        self._process.wait()
        os.close(self._to)
        os.close(self._from)
        self._profile.cleanup()

    def run(self, body: str) -> Any:
        """Run the body of an asynchronous function in the page; return its value. Raise BrowserError if it fails."""
        arguments = {"expression": f"(async () => {{{body}}})()", "awaitPromise": True, "returnByValue": True}
        result = self.call("Runtime.evaluate", **arguments)
        if fault := result.get("exceptionDetails"):
            reason = fault.get("exception", {}).get("description") or fault["text"]
            raise BrowserError(f"script in the browser: {reason.splitlines()[0]}")
        return result["result"].get("value")

    def picture(self) -> bytes:
        """Return the window as a PNG."""
        return base64.b64decode(self.call("Page.captureScreenshot", format="png", optimizeForSpeed=True)["data"])

    def call(self, method: str, **parameters: Any) -> Any:
        """Call a method of the DevTools protocol and return its result."""
        self._number += 1
        message = {"id": self._number, "method": method, "params": parameters}
        if self._session:
            message["sessionId"] = self._session
        try:
            os.write(self._to, json.dumps(message).encode() + b"\0")
        except BrokenPipeError:
            raise BrowserError(ENDED) from None
        while True:
            reply = self._next_message()
            if reply.get("id") == self._number:
                if "error" in reply:
                    raise BrowserError(f"{method} of the browser: {reply['error'].get('message', '')}")
                return reply["result"]
            self._record_errors(reply)

    def _next_message(self) -> Any:
        while b"\0" not in self._rest:
            part = os.read(self._from, 1 << 16)
            if not part:
                raise BrowserError(ENDED)
            self._rest += part
        text, self._rest = self._rest.split(b"\0", 1)
        return json.loads(text)

    def _record_errors(self, event: Any) -> None:
        method, result = event.get("method"), event.get("params", {})
        if method == "Runtime.exceptionThrown":
            self.errors.append(str(result["exceptionDetails"]))
        elif method == "Log.entryAdded" and result["entry"]["level"] == "error":
            self.errors.append(result["entry"]["text"])
        elif method == "Runtime.consoleAPICalled" and result["type"] == "error":
            self.errors.append(str(result["args"]))
