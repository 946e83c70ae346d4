"""Times of a device: examples, a tracer written by hand, tracers, choices of the plan, large scenes, films.

    python -m tests.gpu.times [SECTION ...] [--json FILE] [--size 1920x1080] [--seconds 240]

RAYMARCH_DRAW_BY=fragment or compute chooses the kind of shaders; by default the trial of the device does. All times of
draws are those of the device's timer, in milliseconds: the median of some draws after two that warm up.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import statistics
import time
import unittest.mock
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

os.environ.setdefault("__GL_SHADER_DISK_CACHE", "0")  # a first frame is one without the driver's cache
os.environ.setdefault("MESA_SHADER_CACHE_DISABLE", "true")

import moderngl
import numpy as np

import raymarch as rm
from raymarch.gpu.compute import draws_by, why_drawn_so
from raymarch.plan.device import CLASSES, FORCED
from raymarch.scene import load
from raymarch.scene.quality import TRACERS
from tests.bench import basic

EXAMPLES = Path(__file__).parents[2] / "examples"
DRAWS = 7
CHOSEN = ("village", "columns", "papers/glass", "papers/lights", "papers/array", "showcase/plates", "large/city", "csg")


ONLY: list[str] = []


def names() -> list[str]:
    return ONLY or sorted(str(file.relative_to(EXAMPLES).with_suffix("")) for file in EXAMPLES.rglob("*.py"))


def timed(gl: moderngl.Context, draw: Callable[[], object], draws: int = DRAWS) -> float:
    """The median of the timer over some draws; fewer of slow ones."""
    found: list[float] = []
    for _ in range(2 + draws):
        query = gl.query(time=True)
        with query:
            draw()
        found.append(query.elapsed / 1e6)
        if sum(found) > 1500:
            break
    return statistics.median(found[2:] or found)


def examples(size: tuple[int, int]) -> Iterator[dict[str, Any]]:
    """Evaluations of camera rays, first frame, time of compiling, of drawing, and of a whole frame that is read."""
    for name in names():
        scene = load(EXAMPLES / f"{name}.py")
        row: dict[str, Any] = {"name": name}
        with rm.Renderer(size) as renderer:
            gl = renderer.context.gl
            begin = time.perf_counter()
            row["evaluations"] = float(renderer.render(scene, outputs=("evaluations",)).evaluations.mean())
            begin = time.perf_counter()
            frame = renderer.render(scene)
            _ = frame.color
            row["first_ms"] = 1e3 * (time.perf_counter() - begin)
            row["compile_ms"] = sum(t.compile for t in frame.timings)
            calls = renderer.draw_calls(scene)
            row["passes"] = len(calls)
            with renderer.context.bound():
                row["draw_ms"] = timed(gl, lambda calls=calls: [call.draw() for call in calls])
            begin = time.perf_counter()
            for _ in range(3):
                _ = renderer.render(scene).color
            row["whole_ms"] = 1e3 * (time.perf_counter() - begin) / 3
        yield row


def by_hand(size: tuple[int, int]) -> Iterator[dict[str, Any]]:
    """raymarch beside a tracer written by hand."""
    with rm.Renderer(size) as renderer, renderer.context.bound():
        gl = renderer.context.gl
        for entry in (*basic.basic(renderer), *basic.ours(renderer)):
            entry.first()
            yield {"name": entry.name, "draw_ms": timed(gl, entry.draw)}


def choices(size: tuple[int, int]) -> Iterator[dict[str, Any]]:
    """Each choice of the plan, forced, on some examples."""
    forced: dict[str, dict[str, Any]] = {
        "default": {},
        "single": {"schedule": "single"},
        "cone": {"schedule": "cone"},
        "no closed forms": {"analytic": False},
        "boxes": {"bounding_volumes": True},
        "no boxes": {"bounding_volumes": False},
        "data": {"objects": "data"},
        "advance": {"tracer": "advance"},
    }
    for name in CHOSEN:
        scene = load(EXAMPLES / f"{name}.py")
        row: dict[str, Any] = {"name": name}
        for title, settings in forced.items():
            row[title] = draw_time(scene.replace(quality=scene.quality.replace(**settings)), size)
        yield row


def draw_time(scene: rm.Scene, size: tuple[int, int]) -> float | str:
    try:
        with rm.Renderer(size) as renderer:
            calls = renderer.draw_calls(scene)
            with renderer.context.bound():
                return timed(renderer.context.gl, lambda: [call.draw() for call in calls], 5)
    except Exception as error:
        return type(error).__name__


def tracers(size: tuple[int, int]) -> Iterator[dict[str, Any]]:
    """All tracers with everything marched: time and evaluations of camera rays."""
    for name in ("hello", "csg", "village", "columns", "papers/array", "showcase/plates", "papers/carpet"):
        scene = load(EXAMPLES / f"{name}.py")
        for tracer in TRACERS:
            if tracer == "auto":
                continue
            quality = scene.quality.replace(tracer=tracer, schedule="single", analytic=False, omega=None)
            one = scene.replace(quality=quality)
            with rm.Renderer(size) as renderer:
                count = float(renderer.render(one, outputs=("evaluations",)).evaluations.mean())
            yield {"name": name, "tracer": tracer, "ms": draw_time(one, size), "evaluations": count}


def large(size: tuple[int, int]) -> Iterator[dict[str, Any]]:
    """Spheres by the thousand: planning, first frame, frame."""
    for count in (1_000, 10_000, 100_000):
        rng = np.random.default_rng(1)
        side = count ** (1 / 3)
        scene = rm.Scene(
            rm.union(*[rm.sphere(0.3).translate(tuple(p)) for p in rng.uniform(-side, side, (count, 3))]),
            camera=rm.Camera((0, side, 3 * side), (0, 0, 0)),
        )
        begin = time.perf_counter()
        with rm.Renderer(size) as renderer:
            _ = renderer.render(scene).color
            first = time.perf_counter() - begin
            calls = renderer.draw_calls(scene)
            with renderer.context.bound():
                yield {
                    "name": f"{count} spheres",
                    "first_ms": 1e3 * first,
                    "draw_ms": timed(renderer.context.gl, lambda calls=calls: [call.draw() for call in calls]),
                }


def reading(size: tuple[int, int]) -> Iterator[dict[str, Any]]:
    """What a picture takes beside the drawing: a frame of 2 x 2 pixels, and reading back a whole one."""
    for name in names():
        scene = load(EXAMPLES / f"{name}.py")
        with rm.Renderer((2, 2)) as renderer:
            times = []
            for i in range(12):
                begin = time.perf_counter()
                _ = renderer.render(scene, time=i / 60).color
                times.append(1e3 * (time.perf_counter() - begin))
        yield {"name": name, "cpu_ms": statistics.median(times[3:])}


def classes(size: tuple[int, int]) -> Iterator[dict[str, Any]]:
    """Plans for both classes of devices: compiling and drawing, taking turns, and how far the pictures differ."""
    for name in names():
        row: dict[str, Any] = {"name": name}
        pictures = []
        for device in CLASSES:
            with plan_for(device), rm.Renderer(size) as renderer:
                scene = load(EXAMPLES / f"{name}.py")
                frame = renderer.render(scene)
                pictures.append(frame.color)
                row[f"{device}_compile_ms"] = sum(t.compile for t in frame.timings)
        with plan_for("software"), rm.Renderer(size) as one, plan_for("hardware"), rm.Renderer(size) as other:
            calls = {}
            for device, renderer in zip(("software", "hardware"), (one, other), strict=True):
                with plan_for(device):
                    calls[device] = renderer, renderer.draw_calls(scene)
            found: dict[str, list[float]] = {device: [] for device in calls}
            for _ in range(3):
                for device, (renderer, drawn) in calls.items():
                    with renderer.context.bound():
                        found[device].append(timed(renderer.context.gl, lambda d=drawn: [c.draw() for c in d], 3))
        row |= {f"{device}_draw_ms": min(times) for device, times in found.items()}
        row["ratio"] = row["hardware_draw_ms"] / row["software_draw_ms"]
        row["differing"] = float((np.abs(pictures[0] - pictures[1]).max(axis=-1) > 1e-3).mean())
        yield row


@contextlib.contextmanager
def plan_for(device: str) -> Iterator[None]:
    """Plans for a class of devices, whatever the driver."""
    with unittest.mock.patch.dict(os.environ, {FORCED: device}):
        yield


SECTIONS: dict[str, Callable[[tuple[int, int]], Iterator[dict[str, Any]]]] = {
    "examples": examples,
    "by_hand": by_hand,
    "tracers": tracers,
    "large": large,
    "reading": reading,
    "choices": choices,
    "classes": classes,
}


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("sections", nargs="*", default=list(SECTIONS))
    parser.add_argument("--only", nargs="*", default=[], help="examples")
    parser.add_argument("--json", type=Path)
    parser.add_argument("--size", default="1920x1080")
    parser.add_argument("--seconds", type=float, default=240)
    given = parser.parse_args(arguments)
    ONLY.extend(given.only)
    width, height = map(int, given.size.split("x"))
    end = time.monotonic() + given.seconds
    found: dict[str, list[dict[str, Any]]] = {}
    with rm.Renderer((16, 16)) as renderer:
        print(renderer.context.driver, draws_by(renderer.context), "shaders:", why_drawn_so(renderer.context))
    for section in given.sections:
        rows = found.setdefault(section, [])
        begin = time.monotonic()
        try:
            for row in SECTIONS[section]((width, height)):
                rows.append(row)
                print(section, " ".join(f"{k}={v:.4g}" if isinstance(v, float) else f"{k}={v}" for k, v in row.items()))
                if time.monotonic() > end:
                    break
        except Exception as error:
            print(section, "fails:", type(error).__name__, " ".join(str(error).split())[:300])
        print(f"# {section}: {time.monotonic() - begin:.1f} s", flush=True)
        if given.json is not None:
            given.json.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
