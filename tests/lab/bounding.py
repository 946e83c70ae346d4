"""Scenes with bounding volumes on and off: evaluations of costly solids a pixel, CPU time of frames drawn in turn.

python -m tests.lab.bounding [NAME...] [--size 320x180] [--frames 5]

Evaluations are counted in the shader, in the functions of the operands with boxes: by camera rays, shadow rays and
gradients. Objects are text: rows have cells in place of boxes. Frames are drawn in the calling thread
(LP_NUM_THREADS=0), so the CPU time of the process is that of the frames.
"""

from __future__ import annotations

import os

os.environ.update(LP_NUM_THREADS="0", MESA_SHADER_CACHE_DISABLE="true")

import argparse
import re
import runpy
import statistics
import sys
import time
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any
from unittest import mock

import numpy as np

import raymarch as rm
from raymarch.expr.node import const
from raymarch.plan import bounding, plan
from raymarch.plan.bounding import BoundedUnion
from raymarch.shader.assemble import Shader
from tests.support.timing import frame_times

SUN = rm.Sun(sun_direction=(0.6, 1, 0.5), shadow=True)


def rows(form: Callable[[int], rm.Node], count: int) -> rm.Scene:
    """Solids in rows on a floor."""
    solids = [form(i).translate((1.4 * (i % 4 - 1.5), 0, -1.4 * (i // 4))) for i in range(count)]
    camera = rm.Camera(position=(2, 3, 4), target=(0, 0, -0.7 * (count // 4)), fov=45)
    return rm.Scene(rm.union(rm.plane(offset=-0.5), *solids), camera, [SUN])


def cluster(i: int) -> rm.Node:
    """A blend of three polyhedra, without a loop."""
    parts = (rm.truncated_icosahedron(0.6 + 0.02 * i), rm.truncated_dodecahedron(0.6), rm.icosidodecahedron(0.6))
    return rm.union(*[part.rotate(0.3 * k, "y") for k, part in enumerate(parts)], k=0.1)


FORMS: dict[str, Callable[[int], rm.Node]] = {
    "ellipsoids": lambda i: rm.ellipsoid((0.9, 0.4 + 0.05 * i, 0.8)),
    "helices": lambda i: rm.helix(0.36, 0.05 + 0.005 * i, 0.24, 3.0),
    "tubes": lambda i: rm.bezier_tube((0.2, 0.4, 0), (0.75, 0.5 + 0.05 * i, 0), (0.3, -0.1, 0), 0.035),
    "sponges": lambda i: rm.menger(0.9, 4).rotate(0.3 * i, "y"),
    "pyramids": lambda i: rm.sierpinski(0.9, 8).rotate(0.3 * i, "y"),
    "clusters": cluster,
    "boxes": lambda i: rm.box((0.8, 0.6, 0.4)).round(0.1).rotate(0.3 * i, "y"),
}

FILES = ("large/costly", "papers/array", "showcase/lanterns")

SCENES: dict[str, Callable[[], rm.Scene]] = {
    **{name: lambda name=name: runpy.run_path(f"examples/{name}.py")["scene"] for name in FILES},
    **{f"{name} {n}": lambda f=f, n=n: rows(f, n) for name, f in FORMS.items() for n in (2, 8)},
}


@contextmanager
def counted(everywhere: bool) -> Iterator[None]:
    """Inside, a picture is the number of evaluations of operands with boxes; `everywhere`: with boxes of all space."""
    text, begin = Shader.text, BoundedUnion.__post_init__
    box = bounding.distance_to_box

    def renamed(self: BoundedUnion) -> None:
        for _, function in self.operands[len(self.operands) - len(self.boxes) :]:
            function.name = "costly_field"
        begin(self)

    def changed(self: Shader, *args: Any, **named: Any) -> str:
        lines = text(self, *args, **named)
        lines = re.sub(r"(?m)^((?:float|vec4) costly_\w+\(vec3 p\) \{)$", r"\1 costly_count += 1.0;", lines)
        lines = re.sub(r"(?m)^(#version .*\n(?:#define .*\n)*)", r"\1float costly_count = 0.0;\n", lines, count=1)
        last = "hit.done ? 1.0 : 0.0);"
        assert last in lines, "the color pass ends in another line"
        return lines.replace(last, f"{last}\n    out_color = vec4(costly_count);")

    with (
        mock.patch.object(Shader, "text", changed),
        mock.patch.object(BoundedUnion, "__post_init__", renamed),
        mock.patch.object(bounding, "distance_to_box", lambda f, p: const(-1.0) if everywhere else box(f, p)),
    ):
        yield


def evaluations(scene: rm.Scene, size: tuple[int, int], choice: bool | None, everywhere: bool) -> np.ndarray:
    """Evaluations of costly solids in each pixel."""
    with counted(everywhere), rm.Renderer(size) as renderer:
        made = scene.replace(quality=scene.quality.replace(bounding_volumes=choice, objects="text", samples=1))
        return renderer.render(made).color[..., 0]


def compare(scene: rm.Scene, size: tuple[int, int], frames: int) -> dict[str, list[float]]:
    """Of each choice: seconds to the first frame, median and least milliseconds of a frame, evaluations, pixels that
    differ from the picture without bounding volumes, and the largest difference."""
    choices = {"off": False, "auto": None, "on": True}
    found: dict[str, list[float]] = {}
    pictures = {}
    with rm.Renderer(size) as renderer:
        text = scene.quality.replace(objects="text")
        scenes = {n: scene.replace(quality=text.replace(bounding_volumes=c)) for n, c in choices.items()}
        for name, made in scenes.items():
            begin = time.process_time()
            frame = renderer.render(made)
            pictures[name] = frame.color
            first = time.process_time() - begin
            image = np.asarray(frame.image()).astype(int)
            pictures[name] = image
            differing = np.abs(image - pictures["off"]).max(axis=-1)
            asked = choices[name] if name != "off" else None if plan(scenes["auto"]).bounding.used else True
            count = evaluations(scene, size, asked, name == "off").mean()
            found[name] = [first, 0.0, 0.0, float(count), int((differing > 0).sum()), int(differing.max())]
        times = frame_times(renderer, scenes, frames)
    for name, row in found.items():
        row[1], row[2] = statistics.median(times[name]), min(times[name])
    return found


def main(arguments: list[str]) -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", default=[*SCENES])
    parser.add_argument("--size", default="320x180")
    parser.add_argument("--frames", type=int, default=5)
    given = parser.parse_args(arguments)
    width, height = map(int, given.size.split("x"))
    warnings.simplefilter("ignore")
    print("| scene | | first s | frame ms | least ms | costly evaluations | pixels that differ | by at most | of off |")
    print("|---|---|---|---|---|---|---|---|---|")
    for name in given.names:
        result = compare(SCENES[name](), (width, height), given.frames)
        for choice, row in result.items():
            of_off = row[1] / result["off"][1]
            cells = (
                f"{row[0]:.2f}",
                f"{row[1]:.1f}",
                f"{row[2]:.1f}",
                f"{row[3]:.2f}",
                row[4],
                row[5],
                f"{of_off:.2f}",
            )
            print("|", " | ".join(map(str, (name, choice, *cells))), "|", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
