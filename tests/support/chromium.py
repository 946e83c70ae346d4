"""A headless Chromium that draws by SwiftShader, driven through a pipe by the DevTools protocol."""

from __future__ import annotations

import base64
import json
import os
import select
import shutil
import subprocess
import tempfile
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")

FLAGS = (
    *(
        "--headless=new",
        "--no-sandbox",
        "--use-angle=swiftshader",
        "--enable-unsafe-swiftshader",
        "--disable-gpu-sandbox",
    ),
    *("--remote-debugging-pipe", "--no-first-run", "--disable-extensions", "--hide-scrollbars", "--mute-audio"),
    *("--disable-dev-shm-usage", "--disable-background-networking"),
    *("--enable-unsafe-webgpu", "--use-webgpu-adapter=swiftshader"),
    "--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE 127.0.0.1",
)

LIMIT = 180.0
"""Seconds after which an answer of the browser is taken not to come. Nothing takes nearly so long."""


def find() -> str | None:
    """The path of a Chromium, or None."""
    return next(filter(None, map(shutil.which, NAMES)), None)


class Browser:
    """One page. Use it as a context manager."""

    def __init__(self, width: int = 1280, height: int = 720) -> None:
        path = find()
        assert path is not None
        self._folder = tempfile.TemporaryDirectory(ignore_cleanup_errors=True)
        to_read, self._to = os.pipe()
        self._from, to_write = os.pipe()

        def prepare() -> None:  # the protocol is on descriptors 3 and 4
            os.dup2(to_read, 13)
            os.dup2(to_write, 14)
            os.dup2(13, 3)
            os.dup2(14, 4)

        self._process = subprocess.Popen(
            [path, *FLAGS, f"--user-data-dir={self._folder.name}", f"--window-size={width},{height}", "about:blank"],
            close_fds=False,
            preexec_fn=prepare,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        )
        os.close(to_read)
        os.close(to_write)
        self._number = 0
        self._session: str | None = None
        self.messages: list[str] = []
        (page,) = [t for t in self.call("Target.getTargets")["targetInfos"] if t["type"] == "page"]
        self._session = self.call("Target.attachToTarget", targetId=page["targetId"], flatten=True)["sessionId"]
        self.call("Runtime.enable")
        self.call("Page.enable")
        self.resize(width, height)

    def call(self, method: str, **params: Any) -> Any:
        """The result of a command of the protocol."""
        self._number += 1
        message = {"id": self._number, "method": method, "params": params}
        if self._session:
            message["sessionId"] = self._session
        os.write(self._to, json.dumps(message).encode() + b"\0")
        while True:
            answer = json.loads(self._read())
            if answer.get("method") in ("Runtime.exceptionThrown", "Runtime.consoleAPICalled"):
                self.messages.append(json.dumps(answer["params"])[:500])
            if answer.get("id") == self._number:
                if "error" in answer:
                    raise RuntimeError(f"{method}: {answer['error']}")
                return answer["result"]

    def _read(self) -> bytes:
        found = bytearray()
        while True:
            part, self._rest = self._rest, b""
            if not part:
                if not select.select([self._from], [], [], LIMIT)[0]:
                    raise RuntimeError(f"the browser has not answered for {LIMIT:g} s")
                part = os.read(self._from, 1 << 16)
            if not part:
                raise RuntimeError("the browser has ended")
            message, end, rest = part.partition(b"\0")
            found += message
            if end:
                self._rest = rest
                return bytes(found)

    _rest = b""

    def resize(self, width: int, height: int, mobile: bool = False) -> None:
        """Set the size of the page."""
        self.call("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=mobile)

    def open(self, file: Path) -> None:
        """Load a page and wait until it draws."""
        self.call("Page.navigate", url=file.resolve().as_uri())
        self.run(
            "new Promise((done, fail) => { const wait = () => window.raymarch ? done() : "
            "document.getElementById('fault')?.textContent ? fail(document.getElementById('fault').textContent) : "
            "document.readyState === 'complete' && !document.getElementById('fault') ? fail(document.title) : "
            "setTimeout(wait, 20); wait(); })"
        )

    def run(self, code: str) -> Any:
        """The value of an expression of JavaScript; a promise is awaited."""
        found = self.call("Runtime.evaluate", expression=code, awaitPromise=True, returnByValue=True, timeout=120000)
        if "exceptionDetails" in found:
            raise RuntimeError(str(found["exceptionDetails"])[:2000])
        return found["result"].get("value")

    def until(self, condition: str) -> None:
        """Wait until an expression of JavaScript is true."""
        code = "new Promise((done, fail) => { const end = performance.now() + LIMIT, wait = () => (CONDITION) ? done() "
        code += ": performance.now() > end ? fail(document.title) : setTimeout(wait, 20); wait(); })"
        try:
            self.run(code.replace("LIMIT", f"{500 * LIMIT:g}").replace("CONDITION", condition))
        except RuntimeError as fault:
            raise AssertionError(f"never true: {condition}") from fault

    def picture(self, width: int, height: int, samples: int = 1, view: int = 0) -> NDArray[np.uint8]:
        """A picture that the page draws, (height, width, 3), row 0 at the top."""
        code = (
            f"(() => {{ const b = raymarch.picture({width}, {height}, {samples}, {view}); let s = ''; "
            "for (let i = 0; i < b.length; i += 8192) s += String.fromCharCode(...b.subarray(i, i + 8192)); "
            "return btoa(s); })()"
        )
        data = np.frombuffer(base64.b64decode(self.run(code)), np.uint8)
        return data.reshape(height, width, 4)[::-1, :, :3]

    def screenshot(self, file: Path) -> None:
        """Save what the page shows."""
        file.write_bytes(base64.b64decode(self.call("Page.captureScreenshot", format="png")["data"]))

    def drag(self, start: tuple[int, int], end: tuple[int, int], modifiers: int = 0) -> None:
        """Drag with the left button, by real events."""
        options = {"button": "left", "clickCount": 1, "modifiers": modifiers}
        self.call("Input.dispatchMouseEvent", type="mousePressed", x=start[0], y=start[1], **options)
        for k in (0.5, 1.0):
            x, y = (a + k * (b - a) for a, b in zip(start, end, strict=True))
            self.call("Input.dispatchMouseEvent", type="mouseMoved", x=x, y=y, buttons=1, **options)
        self.call("Input.dispatchMouseEvent", type="mouseReleased", x=end[0], y=end[1], **options)

    def close(self) -> None:
        """End the browser."""
        self._process.terminate()
        try:
            self._process.wait(10)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        os.close(self._from)
        os.close(self._to)
        self._folder.cleanup()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


class Tint:
    """Chromium's compiler of WGSL."""

    def __init__(self) -> None:
        self._folder = tempfile.TemporaryDirectory()
        page = Path(self._folder.name, "page.html")
        page.write_text("<!doctype html><title>a page of a file may use WebGPU</title>")
        self._browser = Browser()
        self._browser.call("Page.navigate", url=page.as_uri())
        self._browser.run(
            "new Promise(done => document.readyState === 'complete' ? done() : addEventListener('load', done)).then("
            "async () => { window.device = await (await navigator.gpu.requestAdapter()).requestDevice(); })"
        )

    def refused(self, code: str) -> str:
        """The compiler's messages; empty if it takes the code."""
        return str(
            self._browser.run(
                f"(async () => {{ device.pushErrorScope('validation'); "
                f"const made = device.createShaderModule({{code: {json.dumps(code)}}}); "
                "const found = (await made.getCompilationInfo()).messages.filter(m => m.type == 'error'); "
                "await device.popErrorScope(); "
                "return found.map(m => `${m.lineNum}: ${m.message}`).join('\\n'); })()"
            )
        )

    def close(self) -> None:
        """End the browser."""
        self._browser.close()
        self._folder.cleanup()
