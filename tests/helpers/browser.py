"""A browser without a window, driven over its debugging protocol: what a page does when it is opened."""

from __future__ import annotations

import base64
import contextlib
import json
import os
import pathlib
import secrets
import shutil
import socket
import struct
import subprocess
import tempfile
import time
import urllib.parse
from collections.abc import Iterator
from typing import Any

NAMES = (
    "chromium",
    "chromium-browser",
    "google-chrome",
    "google-chrome-stable",
    "chrome",
    "msedge",
    "microsoft-edge",
)
PLACES = (
    "/Applications/Google Chrome.app/Contents/MacOS/Google Chrome",
    r"C:\Program Files\Google\Chrome\Application\chrome.exe",
    r"C:\Program Files (x86)\Microsoft\Edge\Application\msedge.exe",
)
# WebGL by software: a machine without a screen has no graphics card either.
FLAGS = (
    "--headless=new", "--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--no-first-run",
    "--disable-extensions", "--disable-background-networking", "--disable-component-update", "--hide-scrollbars",
    "--remote-debugging-port=0", "--disable-dev-shm-usage",
)  # fmt: skip
PATIENCE = 60.0  # seconds for an answer; a browser that takes longer does not work on this machine


def found() -> str | None:
    """The program of a browser, or None."""
    named = next((path for name in NAMES if (path := shutil.which(name))), None)
    return named or next((place for place in PLACES if os.path.exists(place)), None)


class BrowserFailed(Exception):
    """The browser did not start, or does not answer."""


class _Socket:
    """A client of a web socket (RFC 6455): texts in both directions, as long as they come whole."""

    def __init__(self, url: str) -> None:
        parts = urllib.parse.urlsplit(url)
        assert parts.hostname
        assert parts.port
        self._socket = socket.create_connection((parts.hostname, parts.port), PATIENCE)
        self._rest = b""
        key = base64.b64encode(secrets.token_bytes(16)).decode()
        request = (
            f"GET {parts.path} HTTP/1.1\r\nHost: {parts.netloc}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
            f"Sec-WebSocket-Key: {key}\r\nSec-WebSocket-Version: 13\r\n\r\n"
        )
        self._socket.sendall(request.encode())
        while b"\r\n\r\n" not in self._rest:
            self._rest += self._more()
        head, _, self._rest = self._rest.partition(b"\r\n\r\n")
        if b" 101 " not in head.split(b"\r\n")[0]:
            raise BrowserFailed(head.decode(errors="replace"))

    def send(self, text: str) -> None:
        data = text.encode()
        length = len(data)
        head = b"\x81"
        if length < 126:
            head += bytes([0x80 | length])
        elif length < 1 << 16:
            head += b"\xfe" + struct.pack(">H", length)
        else:
            head += b"\xff" + struct.pack(">Q", length)
        mask = secrets.token_bytes(4)
        self._socket.sendall(head + mask + bytes(b ^ mask[i % 4] for i, b in enumerate(data)))

    def receive(self) -> str:
        data, last = b"", False
        while not last:
            first, second = self._take(2)
            last, length = bool(first & 0x80), second & 0x7F
            if length == 126:
                (length,) = struct.unpack(">H", self._take(2))
            elif length == 127:
                (length,) = struct.unpack(">Q", self._take(8))
            part = self._take(length)
            if first & 0x0F in (0, 1):
                data += part
            elif first & 0x0F == 8:
                raise BrowserFailed("the browser closed the connection")
            else:
                last = False
        return data.decode()

    def close(self) -> None:
        self._socket.close()

    def _take(self, count: int) -> bytes:
        while len(self._rest) < count:
            self._rest += self._more()
        taken, self._rest = self._rest[:count], self._rest[count:]
        return taken

    def _more(self) -> bytes:
        part = self._socket.recv(1 << 16)
        if not part:
            raise BrowserFailed("the browser closed the connection")
        return part


class Browser:
    """A running browser; `Page` opens pages in it. Leave it with `close`."""

    def __init__(self, program: str, flags: tuple[str, ...] = FLAGS) -> None:
        self._folder = tempfile.TemporaryDirectory(ignore_cleanup_errors=True)
        # Its output is not read: a pipe that nobody empties would stop it.
        self._process = subprocess.Popen(
            [program, *flags, f"--user-data-dir={self._folder.name}", "about:blank"],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        try:
            self._socket = _Socket(self._address())
        except (BrowserFailed, OSError):
            self._end()
            raise BrowserFailed(f"{program} does not start") from None
        self._number = 0
        self.events: list[dict[str, Any]] = []

    def _address(self) -> str:
        told = pathlib.Path(self._folder.name) / "DevToolsActivePort"
        for _ in range(int(PATIENCE / 0.1)):
            lines = told.read_text().split("\n") if told.exists() else []
            if len(lines) >= 2 and lines[1]:
                return f"ws://127.0.0.1:{lines[0]}{lines[1]}"
            if self._process.poll() is not None:
                break
            time.sleep(0.1)
        raise BrowserFailed("no port")

    def call(self, method: str, session: str | None = None, **parameters: Any) -> dict[str, Any]:
        """The answer to a call of the protocol; events that come before it are kept."""
        self._number += 1
        sent = {"id": self._number, "method": method, "params": parameters}
        self._socket.send(json.dumps(sent | ({"sessionId": session} if session else {})))
        while True:
            found = json.loads(self._socket.receive())
            if found.get("id") == self._number:
                if "error" in found:
                    raise BrowserFailed(f"{method}: {found['error']}")
                return dict(found["result"])
            self.events.append(found)

    def close(self) -> None:
        """End the browser."""
        with contextlib.suppress(BrowserFailed, OSError):
            self.call("Browser.close")
        self._socket.close()
        self._end()

    def _end(self) -> None:
        try:
            self._process.wait(10)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._folder.cleanup()


class Page:
    """A page in a browser, of this width and height; features: of `prefers-...`."""

    def __init__(
        self, browser: Browser, size: tuple[int, int] = (1200, 760), mobile: bool = False, **features: str
    ) -> None:
        self._browser = browser
        target = browser.call("Target.createTarget", url="about:blank")["targetId"]
        self._session = browser.call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        for domain in ("Page", "Runtime", "Log", "Network"):
            self.call(f"{domain}.enable")
        width, height = size
        self.call(
            "Emulation.setDeviceMetricsOverride",
            width=width,
            height=height,
            deviceScaleFactor=1,
            mobile=mobile,
        )
        given = [{"name": name.replace("_", "-"), "value": value} for name, value in features.items()]
        self.call("Emulation.setEmulatedMedia", media="", features=given)

    def call(self, method: str, **parameters: Any) -> dict[str, Any]:
        """A call of the protocol for this page."""
        return self._browser.call(method, self._session, **parameters)

    def open(self, path: pathlib.Path) -> None:
        """Open a file and wait until it says that it is ready."""
        self.call("Page.navigate", url=path.resolve().as_uri())
        for _ in range(int(PATIENCE / 0.05)):
            if self.value("document.readyState === 'complete' && Boolean(window.animation || window.failed)"):
                return
            if self.errors():
                return
            time.sleep(0.05)
        raise BrowserFailed("the page is not ready")

    def value(self, expression: str) -> Any:
        """The value of an expression on the page, as JSON carries it."""
        found = self.call("Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True)
        if "exceptionDetails" in found:
            raise BrowserFailed(json.dumps(found["exceptionDetails"])[:800])
        return found["result"].get("value")

    def key(self, key: str) -> None:
        """Press and release a key."""
        for kind in ("keyDown", "keyUp"):
            text = {"text": key} if kind == "keyDown" and len(key) == 1 else {}
            self.call("Input.dispatchKeyEvent", type=kind, key=key, **text)

    def drag(self, begin: tuple[float, float], end: tuple[float, float]) -> None:
        """Drag with the left button."""
        steps = [("mousePressed", begin), ("mouseMoved", end), ("mouseReleased", end)]
        for kind, (x, y) in steps:
            self.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", buttons=1, clickCount=1)

    def errors(self) -> list[str]:
        """Errors and warnings of the console, exceptions, and requests to anywhere but the file itself."""
        return list(self._errors())

    def _errors(self) -> Iterator[str]:
        for event in self._browser.events:
            if event.get("sessionId") != self._session:
                continue
            method, parameters = event["method"], event["params"]
            if method == "Runtime.exceptionThrown":
                yield json.dumps(parameters["exceptionDetails"])[:600]
            elif method == "Runtime.consoleAPICalled" and parameters["type"] in (
                "error",
                "warning",
                "assert",
            ):
                yield str([argument.get("value") for argument in parameters["args"]])
            elif method == "Log.entryAdded" and parameters["entry"]["level"] in ("error", "warning"):
                text = parameters["entry"]["text"]
                # Said of reading back a picture by software.
                if "GPU stall" not in text:
                    yield text
            elif method == "Network.requestWillBeSent":
                url = parameters["request"]["url"]
                if not url.startswith(("file:", "data:", "about:")):
                    yield f"request of {url}"

    def picture(self, path: pathlib.Path) -> None:
        """Write a picture of the page as PNG."""
        path.write_bytes(base64.b64decode(self.call("Page.captureScreenshot", format="png")["data"]))
