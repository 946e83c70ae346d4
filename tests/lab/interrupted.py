"""Signals at random moments, for notebooks and for clusters.

python -m tests.lab.interrupted kernel [--count 40] [--seed 0]
python -m tests.lab.interrupted workers [--count 40] [--seed 0]

`kernel`: a real kernel draws scenes whose shaders are compiled each time, without the driver's cache, and gets SIGINT
after a random time. At fault are a kernel that dies, a cell that ends in anything but its value or KeyboardInterrupt,
and a kernel that then does not draw the right picture.

`workers`: one to three signals to processes of the workers of a film, or Ctrl+C to all processes. At fault are a film
that is not as without a cluster and says nothing, a traceback, and processes that are left.
"""

from __future__ import annotations

import argparse
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import psutil

BEGIN = """
import hashlib, raymarch as rm
def scene(k):
    parts = [rm.torus(1, .1 + .01 * i).translate((i % 3, 0, i // 3)) for i in range(6)]
    quality = rm.Quality(tracer=("plain", "auto_relaxed")[k % 2])
    lights = [rm.SphereLight((4, 6, 5), 0.5, shadow=True)]
    return rm.Scene(rm.union(*parts, k=.1 + .001 * k).twist(.3), lights=lights, quality=quality)
def digest(k):
    return hashlib.sha256(rm.render(scene(k), size=(32, 18)).tobytes()).hexdigest()
known = digest(0)
"""
CELLS = (
    "digest({k})",
    "rm.Renderer(size=(32, 18)).render(scene({k})).depth.sum()",
    "scene({k})",
    "rm.show(scene({k}))",
    "rm.raycast(scene({k}), [(0, 0, 9)] * 500, [(0, 0, -1)] * 500)",
)

SCENE = """import raymarch as rm
parts = [rm.torus(0.6, 0.1 + 0.02 * i).translate((i - 1 + rm.sin(rm.time + i), 0, 0)) for i in range(3)]
scene = rm.Scene(rm.union(*parts, k=0.1) | rm.plane(offset=-0.5))
"""
SIGNALS = (signal.SIGTERM, signal.SIGKILL, signal.SIGINT, signal.SIGHUP, signal.SIGQUIT, signal.SIGSTOP)


@contextmanager
def kernel() -> Iterator[Any]:
    """A client of a new kernel that has run `BEGIN`."""
    from jupyter_client.manager import KernelManager

    manager = KernelManager(kernel_name="python3")
    manager.kernel_cmd = [sys.executable, "-m", "ipykernel_launcher", "-f", "{connection_file}"]
    manager.start_kernel(env={**os.environ, "MESA_SHADER_CACHE_DISABLE": "true"})
    try:
        client = manager.client()
        client.start_channels()
        client.wait_for_ready(timeout=60)
        reply = client.execute(BEGIN, reply=True, timeout=120)
        assert reply["content"]["status"] == "ok", reply["content"]
        yield manager, client
    finally:
        client.stop_channels()
        manager.shutdown_kernel(now=True)


def replied(manager: Any, client: Any, message: str, after: float | None) -> dict[str, Any] | None:
    """The reply to a message; the kernel is interrupted `after` seconds. None if it dies."""
    begun, told = time.monotonic(), False
    while True:
        if after is not None and not told and time.monotonic() - begun > after:
            manager.interrupt_kernel()
            told = True
        try:
            reply = client.get_shell_msg(timeout=0.02)
        except Exception:  # nothing came
            if not manager.is_alive():
                return None
            if time.monotonic() - begun > 120:
                return {"status": "error", "ename": "hangs", "evalue": "120 s"}
            continue
        if reply["parent_header"].get("msg_id") == message:
            content: dict[str, Any] = reply["content"]
            return content


def try_kernel(count: int, chance: random.Random) -> int:
    """The number of cells that went wrong."""
    ended: Counter[str] = Counter()
    faults, number = 0, 0
    while number < count:
        with kernel() as (manager, client):
            while number < count:
                number += 1
                cell = chance.choice(CELLS).format(k=number)
                after = chance.uniform(0.0, 1.2) ** 2
                found = replied(manager, client, client.execute(cell), after)
                end = "died" if found is None else "value" if found["status"] == "ok" else found["ename"]
                ended[end] += 1
                if end not in ("value", "KeyboardInterrupt"):
                    print(f"{number}: {cell} after {after:.3f} s: {end} {(found or {}).get('evalue')}", flush=True)
                    faults += 1
                if found is None:
                    break
                time.sleep(0.3)  # an interruption that comes late
                check = replied(manager, client, client.execute("assert digest(0) == known"), None)
                if check is None or check["status"] != "ok":
                    print(f"{number}: {cell} after {after:.3f} s, then: {check and check['ename']}", flush=True)
                    faults += 1
                    break
    ends = ", ".join(f"{count} {end}" for end, count in ended.most_common())
    print(f"{count} cells: {ends}; {faults} at fault")
    return faults


def film(folder: Path, name: str, *more: str) -> subprocess.Popen[bytes]:
    """The command that draws 24 frames."""
    words = ["render", "scene.py", "-o", f"{name}_%02d.png", "--frames", "0:24", "--fps", "8", "--size", "48x32"]
    return subprocess.Popen(
        [sys.executable, "-m", "raymarch", *words, *more],
        cwd=folder,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        start_new_session=True,
    )


def disturbed(folder: Path, known: list[bytes], chance: random.Random) -> tuple[str, list[str]]:
    """Draw the film on two local workers, of which some get a signal. Returns what happened, and what is wrong."""
    command = film(folder, "c", "--cluster", "local:2", "--task-timeout", "20")
    me, sent, faults = psutil.Process(command.pid), [], []
    seen: set[psutil.Process] = set()
    begun = time.monotonic()
    ends = [(chance.uniform(0.5, 12.0), chance.choice(SIGNALS), chance.random()) for _ in range(chance.randint(1, 3))]
    whole = chance.random() < 0.2  # Ctrl+C in a terminal reaches all processes
    while command.poll() is None:
        with suppress(psutil.Error):
            seen.update(me.children(recursive=True))
        workers = [each for each in seen if each.is_running() and "spawn_main" in " ".join(_words(each))]
        if ends and workers and time.monotonic() - begun > ends[0][0]:
            _, number, at = ends.pop(0)
            if number == signal.SIGSTOP and not any(folder.glob("c_*.png")):
                number = signal.SIGKILL  # one that hangs while it starts is waited for five minutes
            with suppress(psutil.Error, ProcessLookupError):
                if whole:
                    os.killpg(command.pid, signal.SIGINT)
                else:
                    workers[int(at * len(workers))].send_signal(number)
            sent.append("group SIGINT" if whole else number.name)
            if whole:
                ends.clear()
        if time.monotonic() - begun > 240:
            faults.append("hangs")
            break
        time.sleep(0.05)
    time.sleep(0.5)
    for each in [me, *seen]:
        with suppress(psutil.Error):
            if each.is_running() and each.status() != psutil.STATUS_ZOMBIE:
                faults.append(f"left: {_words(each)}")
                each.kill()
    said = command.communicate()[1].decode(errors="replace")
    told = [line for line in said.splitlines() if line.startswith("raymarch: ")]
    found = [file.read_bytes() for file in sorted(folder.glob("c_*.png"))]
    code = command.returncode
    for word in ("Traceback", "Exception ignored", "Fatal Python", " - ERROR - ", "Warning"):
        if word in said:
            faults.append(f"{word}: {said[-1500:]}")
    if code == 0 and found != known:
        faults.append(f"exit status 0 with {len(found)} frames")
    if code == 2 and not told:
        faults.append("exit status 2 without a reason")
    if code not in ((0, 2, 130) if whole else (0, 2)):
        faults.append(f"exit status {code}: {said[-500:]}")
    if any(frame not in known for frame in found):
        faults.append("a frame that is not whole")
    for file in folder.glob("*c_*"):
        file.unlink()
    return f"{' '.join(sent) or 'nothing'}: {code} {told[-1:]}", faults


def _words(process: psutil.Process) -> list[str]:
    with suppress(psutil.Error):
        return process.cmdline()
    return []


def try_workers(count: int, chance: random.Random) -> int:
    """The number of films that went wrong."""
    wrong = 0
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "scene.py").write_text(SCENE)
        if film(folder, "p").wait():
            raise SystemExit("the film cannot be drawn")
        known = [file.read_bytes() for file in sorted(folder.glob("p_*.png"))]
        for number in range(count):
            happened, faults = disturbed(folder, known, chance)
            print(f"{number}: {happened}", *faults, sep="\n    ", flush=True)
            wrong += bool(faults)
    print(f"{count} films: {wrong} wrong")
    return wrong


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=("kernel", "workers"))
    parser.add_argument("--count", type=int, default=40)
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    run = try_kernel if given.what == "kernel" else try_workers
    sys.exit(run(given.count, random.Random(given.seed)) > 0)


if __name__ == "__main__":
    main()
