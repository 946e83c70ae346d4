"""A real window on a real X display, driven by real events: Xvfb and the XTEST extension."""

from __future__ import annotations

import json
import math
import os
import select
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

import raymarch.errors

ROOT = Path(raymarch.errors.__file__).parents[1]
PATIENCE = 120.0
"""Seconds after which something that must happen is taken not to. Nothing takes nearly so long; a busy machine may."""

Events = list[dict[str, Any]]


@contextmanager
def serve_display(screen: str = "1000x700x24") -> Iterator[str]:
    """The name of an X display of our own; OSError where there is no Xvfb."""
    read_end, write_end = os.pipe()
    command = ["Xvfb", "-displayfd", str(write_end), "-screen", "0", screen, "-nolisten", "tcp", "-noreset"]
    try:
        server = subprocess.Popen(command, pass_fds=(write_end,), stderr=subprocess.DEVNULL)
    except OSError:
        raise OSError("Xvfb cannot be run: install the package xvfb") from None
    finally:
        os.close(write_end)
    try:
        ready, _, _ = select.select([read_end], [], [], PATIENCE)
        number = os.read(read_end, 16).decode().strip() if ready else ""
        if not number:
            raise OSError("Xvfb did not start")
        yield f":{number}"
    finally:
        os.close(read_end)
        server.terminate()
        server.wait()


class Hand:
    """Mouse, keyboard and eyes of somebody before the screen."""

    def __init__(self, display: str) -> None:
        from Xlib import XK, X
        from Xlib.display import Display
        from Xlib.ext import xtest

        self._x, self._keysyms, self._fake = X, XK, xtest.fake_input
        self._display = Display(display)
        self._root = self._display.screen().root
        self._window: Any = None

    def find(self, process: subprocess.Popen[bytes]) -> None:
        """Wait for the window of a process, and give it the keyboard, as a window manager would."""
        until = time.monotonic() + PATIENCE
        number = self._display.intern_atom("_NET_WM_PID")
        while time.monotonic() < until:
            assert process.poll() is None, "the window's process has ended"
            for window in self._root.query_tree().children:
                owner = window.get_full_property(number, self._x.AnyPropertyType)
                viewable = window.get_attributes().map_state == self._x.IsViewable
                if viewable and owner is not None and owner.value[0] == process.pid:
                    self._window = window
                    window.set_input_focus(self._x.RevertToParent, self._x.CurrentTime)
                    self._display.sync()
                    return
            time.sleep(0.02)
        raise AssertionError("no window appeared")

    @property
    def size(self) -> tuple[int, int]:
        shape = self._window.get_geometry()
        return shape.width, shape.height

    def title(self) -> str:
        return str(self._window.get_wm_name())

    def resize(self, width: int, height: int) -> None:
        self._window.configure(width=width, height=height)
        self._display.sync()

    def move(self, x: int, y: int) -> None:
        shape = self._window.get_geometry()
        self._fake(self._display, self._x.MotionNotify, x=shape.x + x, y=shape.y + y)
        self._display.sync()

    def press(self, button: int = 1) -> None:
        self._fake(self._display, self._x.ButtonPress, button)
        self._display.sync()

    def release(self, button: int = 1) -> None:
        self._fake(self._display, self._x.ButtonRelease, button)
        self._display.sync()

    def click(self, x: int, y: int) -> None:
        self.move(x, y)
        self.press()
        self.release()

    def drag(
        self, start: tuple[int, int], end: tuple[int, int], button: int = 1, steps: int = 4, pause: float = 0.0
    ) -> None:
        """Drag in steps with so many seconds between them: fields that are no sliders need more than one frame."""
        self.move(*start)
        self.press(button)
        for i in range(1, steps + 1):
            time.sleep(pause)
            self.move(*(round(a + (b - a) * i / steps) for a, b in zip(start, end, strict=True)))
        time.sleep(pause)
        self.release(button)

    def wheel(self, steps: int) -> None:
        for _ in range(abs(steps)):
            self.press(4 if steps > 0 else 5)
            self.release(4 if steps > 0 else 5)

    def _code(self, name: str) -> int:
        code: int = self._display.keysym_to_keycode(self._keysyms.string_to_keysym(name))
        assert code, f"no key {name}"
        return code

    def hold(self, name: str) -> None:
        self._fake(self._display, self._x.KeyPress, self._code(name))
        self._display.sync()

    def let_go(self, name: str) -> None:
        self._fake(self._display, self._x.KeyRelease, self._code(name))
        self._display.sync()

    def key(self, *names: str) -> None:
        """Press keys together: modifiers first."""
        for name in names:
            self.hold(name)
        for name in reversed(names):
            self.let_go(name)
        time.sleep(0.025)  # what comes sooner is taken for a key that repeats, or for an echo, and is dropped

    def see(self) -> NDArray[np.uint8]:
        """What the window shows: (H, W, 3) of sRGB bytes."""
        width, height = self.size
        image = self._window.get_image(0, 0, width, height, self._x.ZPixmap, 0xFFFFFFFF)
        return np.frombuffer(image.data, np.uint8).reshape(height, width, 4)[..., 2::-1].copy()

    def close_window(self) -> None:
        """What the cross of the window's frame sends."""
        from Xlib.protocol import event

        protocols = self._display.intern_atom("WM_PROTOCOLS")
        delete = self._display.intern_atom("WM_DELETE_WINDOW")
        self._window.send_event(
            event.ClientMessage(window=self._window, client_type=protocols, data=(32, [delete, 0, 0, 0, 0]))
        )
        self._display.sync()

    def drop(self, file: Path) -> None:
        """Drag a file from another program and drop it onto the middle of the window (the XDND protocol, version 5)."""
        from Xlib.protocol import event

        atom = self._display.intern_atom
        selection, kind, copy = atom("XdndSelection"), atom("text/uri-list"), atom("XdndActionCopy")
        source = self._root.create_window(0, 0, 1, 1, 0, self._x.CopyFromParent)
        source.set_selection_owner(selection, self._x.CurrentTime)

        def send(name: str, *data: int) -> None:
            numbers = [source.id, *data, *[0] * (4 - len(data))]
            message = event.ClientMessage(window=self._window, client_type=atom(name), data=(32, numbers))
            self._window.send_event(message)
            self._display.flush()

        width, height = self.size
        send("XdndEnter", 5 << 24, kind)
        send("XdndPosition", 0, (width // 2) << 16 | height // 2, 0, copy)
        self._answer(lambda e: getattr(e, "client_type", None) == atom("XdndStatus"))
        send("XdndDrop", 0, self._x.CurrentTime)
        asked = self._answer(lambda e: e.type == self._x.SelectionRequest)
        asked.requestor.change_property(asked.property, kind, 8, f"{file.as_uri()}\r\n".encode())
        names = {"time": asked.time, "requestor": asked.requestor, "selection": asked.selection}
        asked.requestor.send_event(event.SelectionNotify(target=asked.target, property=asked.property, **names))
        self._answer(lambda e: getattr(e, "client_type", None) == atom("XdndFinished"))
        source.destroy()

    def _answer(self, fits: Callable[[Any], bool]) -> Any:
        until = time.monotonic() + PATIENCE
        while time.monotonic() < until:
            while self._display.pending_events():
                found = self._display.next_event()
                if fits(found):
                    return found
            time.sleep(0.01)
        raise AssertionError("the window does not answer")

    def set_resource(self, text: str) -> None:
        """The settings of the whole screen, such as its density."""
        from Xlib import Xatom

        self._root.change_property(Xatom.RESOURCE_MANAGER, Xatom.STRING, 8, text.encode())
        self._display.sync()

    def done(self) -> None:
        self._display.close()


def alike(seen: Any, expected: Any) -> bool:
    """Whether two pictures of bytes are the same.

    The window's shader gathers samples and so is another text than the renderer's: where a ray grazes an edge, it may
    round to the other side. One pixel in a thousand may differ by more than a level.
    """
    apart = np.abs(np.asarray(seen, int) - np.asarray(expected, int)).max(axis=-1)
    return bool(np.mean(apart > 1) < 1e-3)


class Session:
    """`raymarch view` in a process of its own, the hand that works it, and what it says it does."""

    def __init__(
        self,
        display: str,
        folder: Path,
        scene: Path,
        *options: str,
        moving: bool = False,
        path: Path | None = None,
        command: list[str] | None = None,
    ) -> None:
        """`path` goes before all others where modules are looked for; `command` takes the place of `raymarch view`."""
        self.folder = folder
        self._log = folder / "log.jsonl"
        self._log.unlink(missing_ok=True)
        self.errors = folder / "errors.txt"
        environment = {
            **os.environ,
            "DISPLAY": display,
            "XDG_CONFIG_HOME": str(folder / "config"),
            "PYTHONPATH": os.pathsep.join(str(p) for p in (path, ROOT) if p),
        }
        environment.pop("WAYLAND_DISPLAY", None)
        if command is None:
            command = [sys.executable, "-m", "raymarch", "view", str(scene), "--log", str(self._log), *options]
            command += [] if "--samples" in options else ["--samples", "1"]
            command += [] if "--panel" in options else ["--no-panel"]
        with self.errors.open("w") as errors:
            self.process = subprocess.Popen(command, cwd=folder, env=environment, stderr=errors, stdout=errors)
        self.hand = Hand(display)
        try:
            self.hand.find(self.process)
            self.wait("frame", lambda e: moving or e["whole"])
        except BaseException:
            self.kill()
            raise

    def events(self) -> Events:
        text = self._log.read_text() if self._log.exists() else ""
        return [json.loads(line) for line in text.splitlines(keepends=True) if line.endswith("\n")]

    def mark(self) -> int:
        """Where the log stands now, for `wait`."""
        return len(self.events())

    def wait(
        self, event: str, fits: Callable[[dict[str, Any]], bool] = lambda _: True, since: int = 0
    ) -> dict[str, Any]:
        """The first event of a name that fits, after a mark; waits for it."""
        until = time.monotonic() + PATIENCE
        while True:
            events = self.events()
            for found in events[since:]:
                if found["event"] == event and fits(found):
                    return found
            if self.process.poll() is not None or time.monotonic() > until:
                raise AssertionError(f"no {event}: {events[since:][-20:]}\n{self.errors.read_text()}")
            time.sleep(0.01)

    def raised(self, times: int) -> float:
        """The value of the chosen parameter, raised step by step: a key that follows another too soon is dropped, so
        each waits for the effect of the last."""
        value = -math.inf
        for _ in range(times):
            mark = self.mark()
            self.hand.key("Right")
            value = self.wait("param", lambda e, last=value: e["value"] > last, mark)["value"]
        return value

    def settled(self) -> NDArray[np.uint8]:
        """The picture once all that was done so far is shown, and whole; a key that does nothing marks its end."""
        mark = self.mark()
        self.hand.key("F12")
        self.wait("key", lambda e: e["name"] == "f12", mark)
        at = next(i for i, e in enumerate(self.events()) if i >= mark and e.get("name") == "f12")
        self.wait("idle", since=at)
        return self.hand.see()

    def places(self) -> dict[str, list[int]]:
        """Where the items of the panel are, their middles."""
        return [e["at"] for e in self.events() if e["event"] == "items"][-1]  # type: ignore[no-any-return]

    def item(self, name: str) -> tuple[int, int]:
        """Where an item of the panel is, its middle."""
        x, y = self.places()[name]
        return x, y

    def complaints(self) -> str:
        """What it printed as errors, without the line that a busy machine makes it print at the start."""
        lines = self.errors.read_text().splitlines(keepends=True)
        return "".join(line for line in lines if not line.startswith("raymarch: loading "))

    def end(self) -> int:
        """Wait for the window's end; its exit code."""
        return self.process.wait(PATIENCE)

    def save(self, data: str | bytes, name: str = "scene.py") -> int:
        """Save as editors do: a new file is renamed over the old one. The log's mark before that."""
        mark = self.mark()
        fresh = self.folder / f"{name}.new"
        fresh.write_bytes(data.encode() if isinstance(data, str) else data)
        os.replace(fresh, self.folder / name)
        return mark

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.kill()

    def kill(self) -> None:
        self.hand.done()
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGKILL)
            self.process.wait()
