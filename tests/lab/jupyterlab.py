"""The widget of `rm.show` in a real JupyterLab, by real events: python -m tests.lab.jupyterlab [PYTHON] [PICTURE.png].

PYTHON is an interpreter with jupyterlab and the extra `jupyter`. Needs Chromium. Ends with code 1 if a step fails.
"""

from __future__ import annotations

import json
import os
import socket
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from tests.support.chromium import Browser

CELLS = [
    'import raymarch as rm\nsize = rm.Param("size", 1.0, 0.5, 2.0)\nview = rm.show(rm.sphere(size), (720, 400))\nview',
    "from pathlib import Path\n"
    'view.observe(lambda change: Path("seen.txt").write_text(str(change["new"]["size"])), "params")\n'
    'view.params = {"size": 1.5}',
]
EDITORS = "document.querySelectorAll('.jp-Notebook .jp-CodeCell .cm-content')"
FRAME = "document.querySelector('iframe[srcdoc]')"


def until(browser: Browser, code: str, what: str, seconds: float = 200.0) -> None:
    """Wait until an expression of JavaScript is true."""
    end = time.monotonic() + seconds
    while not browser.run(f"(() => {{ try {{ return Boolean({code}); }} catch {{ return false; }} }})()"):
        if time.monotonic() > end:
            browser.screenshot(Path(tempfile.gettempdir()) / "jupyterlab.png")
            raise SystemExit(f"failed: {what}")
        browser.run("document.querySelector('.jp-Dialog .jp-mod-accept')?.click()")  # which kernel: the one it offers
        time.sleep(0.3)
    print(f"{what}: passed", flush=True)


def main(arguments: list[str]) -> int:
    python, picture = [*arguments, *[sys.executable, ""][len(arguments) :]]
    with tempfile.TemporaryDirectory() as name, socket.socket() as probe:
        folder = Path(name)
        cells = [
            {"cell_type": "code", "execution_count": None, "id": f"c{i}", "metadata": {}, "outputs": [], "source": text}
            for i, text in enumerate(CELLS)
        ]
        kernel = {"display_name": "Python 3", "language": "python", "name": "python3"}
        book = {"cells": cells, "metadata": {"kernelspec": kernel}, "nbformat": 4, "nbformat_minor": 5}
        (folder / "trial.ipynb").write_text(json.dumps(book))
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
        probe.close()
        options = [f"--port={port}", "--no-browser", "--ServerApp.token=", f"--ServerApp.root_dir={name}"]
        server = subprocess.Popen(
            [python, "-m", "jupyterlab", "--ip=127.0.0.1", "--allow-root", *options],
            env={**os.environ, "JUPYTER_CONFIG_DIR": f"{name}/config", "PYTHONPATH": ""},
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        try:
            for _ in range(200):
                with socket.socket() as tried:
                    if tried.connect_ex(("127.0.0.1", port)) == 0:
                        break
                time.sleep(0.3)
            with Browser(1280, 900) as browser:
                browser.call("Page.navigate", url=f"http://127.0.0.1:{port}/lab/tree/trial.ipynb?reset")
                until(browser, f"{EDITORS}.length === 2", "the notebook opens")
                browser.run(f"{EDITORS}[0].focus()")
                idle = "document.querySelector('.jp-Notebook-ExecutionIndicator[data-status=idle]')"
                until(browser, idle, "a kernel runs")
                time.sleep(5)
                press(browser, "Enter", 13, modifiers=8)
                until(browser, f"{FRAME}.contentWindow.raymarch.state.params.u_size === 1", "the page shows the scene")
                browser.run(f"{EDITORS}[1].focus()")
                press(browser, "Enter", 13, modifiers=8)
                until(browser, f"{FRAME}.contentWindow.raymarch.state.params.u_size === 1.5", "Python moves the slider")
                slider = f"{FRAME}.contentDocument.querySelector('input[data-param=size]')"
                browser.run(f"{FRAME}.scrollIntoView(), {FRAME}.focus(), {slider}.focus()")
                press(browser, "End", 35)
                for _ in range(100):
                    time.sleep(0.1)
                    if (folder / "seen.txt").exists() and (folder / "seen.txt").read_text() in ("2", "2.0"):
                        break
                else:
                    raise SystemExit("failed: the slider sets the value in Python")
                print("the slider sets the value in Python: passed")
                if picture:
                    time.sleep(2)
                    browser.screenshot(Path(picture))
        finally:
            server.terminate()
            server.wait(20)
    return 0


def press(browser: Browser, key: str, code: int, modifiers: int = 0) -> None:
    for kind in ("keyDown", "keyUp"):
        browser.call(
            "Input.dispatchKeyEvent", type=kind, key=key, code=key, windowsVirtualKeyCode=code, modifiers=modifiers
        )


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
