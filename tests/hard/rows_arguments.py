"""Cases of what comes in from outside: odd arguments, and faults of disks, pipes and keys."""

from __future__ import annotations

import os
import pickle
import signal
import subprocess
import sys
import tempfile
import warnings
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import numpy as np

import raymarch as rm
from raymarch import cache as disk
from raymarch.sdf.meshes import _from_cache
from raymarch.sdf.sampled import BALL
from tests.hard.world import Figure, World, case, refusals
from tests.support import odd_arguments as odd

SHARE = 40
"""Of the calls with one odd argument one in so many is made here; the tests make them all."""

ROOT = Path(rm.__file__).parents[1]


@case(79, "odd arguments")
def odd_arguments(world: World) -> Iterator[Figure]:
    """Python's own exceptions (OverflowError, AttributeError) reach the user, or an accepted value makes a loop of
    131,071 iterations. Arguments are checked in one place, and every change of a scene goes through its
    constructors."""
    made, wrong = 0, []
    for call in odd.calls():
        for parameter in call.odd():
            for kind, value in odd.ODD.items():
                made += 1
                if made % SHARE == 0:
                    given = {parameter: (value,) if parameter == "*" else value}
                    fault = odd.fault_of(lambda call=call, given=given: call(**given), odd.__file__)
                    wrong += [] if fault is None else [f"{call.name}.{parameter} = {kind}: {fault}"]
    yield Figure(
        f"calls that end in another kind of error, of over {made // SHARE // 100 * 100}",
        len(wrong),
        0,
        "arguments are checked in one place",
    )
    scene = rm.Scene(rm.sphere())
    yield refusals(
        (lambda: scene.replace(quality=scene.quality.replace(max_steps=131071)), ("max_steps = 131071", "60000")),
        (lambda: setattr(scene, "quality", rm.Quality()), ("cannot be assigned", ".replace(quality=...)")),
        (lambda: rm.sphere(10**400), ("an integer of", "> 0")),
        (lambda: rm.box(1).shear(0.5, np.eye(2)), ("shear: axis", "'x', 'y' and 'z'")),
    )
    back = pickle.loads(pickle.dumps(scene))
    yield Figure("scenes that are others after a pickle", back != scene, 0, "equal fields are equal scenes")


@case(80, "faults of disks, pipes and keys")
def faults_from_outside(world: World) -> Iterator[Figure]:
    """A full disk, a closed pipe, a broken cache or an early Ctrl+C gave a traceback and the exit code 1. The user gets
    a message for a fault that the user can mend, and other faults are ignored."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "hello.py").write_text("import raymarch as rm\nscene = rm.sphere()\n")
        (folder / "first").mkdir()
        waits = "import sys, time\nprint('here', file=sys.stderr, flush=True)\ntime.sleep(60)\n"
        (folder / "first" / "pyrr.py").write_text(waits)
        plain = os.environ | {"PYTHONPATH": os.pathsep.join([str(ROOT), *sys.path[1:]])}
        slow = plain | {"PYTHONPATH": f"{folder / 'first'}{os.pathsep}{plain['PYTHONPATH']}"}
        command = [sys.executable, "-m", "raymarch"]

        def start(words: list[str], **how: object) -> subprocess.Popen[bytes]:
            given = {"env": plain, "stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "cwd": folder, **how}
            return subprocess.Popen([*command, *words], **given)  # type: ignore[call-overload,no-any-return]

        head = start(["explain", "hello.py"])
        head.stdout.close()  # type: ignore[union-attr]
        keys = start(["explain", "hello.py"], env=slow)
        keys.stderr.readline()  # type: ignore[union-attr]
        keys.send_signal(signal.SIGINT)
        said = {"a closed pipe": head.stderr.read(), "Ctrl+C": keys.stderr.read()}  # type: ignore[union-attr]
        codes = {"a closed pipe": (head.wait(), 0), "Ctrl+C": (keys.wait(), 130)}
        for process in (head, keys):
            for stream in (process.stdout, process.stderr):
                stream.close()  # type: ignore[union-attr]
        wrong = sum(found != wanted for found, wanted in codes.values()) + sum(map(bool, said.values()))
        yield Figure("wrong exit codes and words of a closed pipe and Ctrl+C", wrong, 0, "0 and 130, without output")

        kept = folder / "cache" / "mesh-0.npz"
        arrays = {"values": BALL.values, "size": np.ones(3), "centre": np.zeros(3), "repairs": np.array([], np.str_)}
        disk.save(kept, arrays)
        whole, unread = kept.read_bytes(), 0
        for content in (b"", b"broken", whole[: len(whole) // 2], whole[:-1]):
            kept.write_bytes(content)
            with suppress(Exception), warnings.catch_warnings():
                warnings.simplefilter("ignore")
                unread += _from_cache(kept, Path("ball.obj")) is None
        yield Figure("broken caches that are not passed over, of 4", 4 - unread, 0, "they are made again")
        disk.save(folder / "hello.py" / "mesh-0.npz", arrays)
        left = {file.name for file in folder.iterdir()} - {"hello.py", "first", "cache"}
        yield Figure("files left by a cache that cannot be written", len(left), 0, "the cache is then not used")
