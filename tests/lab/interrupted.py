"""Interrupts a notebook's kernel at random moments: python -m tests.lab.interrupted [--count 40] [--seed 0].

A real kernel draws scenes whose shaders are compiled each time, without the driver's cache, and gets SIGINT after a
random time. At fault are a kernel that dies, a cell that ends in anything but its value or KeyboardInterrupt, and a
kernel that then does not draw the right picture.
"""

from __future__ import annotations

import argparse
import os
import random
import sys
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

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


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=40)
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    chance = random.Random(given.seed)
    ended: Counter[str] = Counter()
    faults, number = 0, 0
    while number < given.count:
        with kernel() as (manager, client):
            while number < given.count:
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
    print(f"{given.count} cells: {ends}; {faults} at fault")
    sys.exit(faults > 0)


if __name__ == "__main__":
    main()
