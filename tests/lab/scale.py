"""Measure scenes of many objects: build, memory, text, first frame and frame, against the number of objects.

python -m tests.lab.scale                     the table of docs/scale.md
python -m tests.lab.scale --counts 32 2048    some numbers of objects
python -m tests.lab.scale --text 8 32 128     the same scenes with all objects as text
python -m tests.lab.scale --blend 6000        blended objects, against brute force on crops

Each row is measured in a process of its own, without the driver's shader cache. Times are those of the CPU. `again` is
the build with cells from the disk.
"""

from __future__ import annotations

import argparse
import os
import resource
import subprocess
import sys
import tempfile
import time
from typing import Any

import numpy as np

COUNTS = (8, 32, 128, 512, 2048, 10_000, 100_000)
SIZE = (640, 360)
AS_NODES = 2048
"""Up to this number the objects are nodes of a union; above it they are instances of two nodes."""


def solid(n: int, k: float = 0.0, seed: int = 0, nodes: bool | None = None) -> Any:
    """n random boxes and spheres, one to a unit cube on average."""
    import raymarch as rm

    rng = np.random.default_rng(seed)
    side = n ** (1 / 3)
    places = rng.uniform(0.0, side, (n, 3)) - side / 2
    axes = rng.normal(size=(n, 3))
    angles = rng.uniform(0.0, np.pi, n)
    factors = rng.uniform(0.6, 1.4, n)
    if nodes if nodes is not None else n <= AS_NODES:
        made = []
        for i in range(n):
            if i % 2:
                made.append(rm.sphere(0.25 * factors[i]).translate(places[i]))
            else:
                box = rm.box((0.3 * factors[i], 0.4 * factors[i], 0.5 * factors[i]))
                made.append(box.rotate(angles[i], axes[i]).translate(places[i]))
        return rm.union(*made, k=k)
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    skew = np.zeros((n, 3, 3))
    skew[:, 0, 1], skew[:, 0, 2], skew[:, 1, 2] = -axes[:, 2], axes[:, 1], -axes[:, 0]
    skew -= np.swapaxes(skew, 1, 2)
    c, s = np.cos(angles)[:, None, None], np.sin(angles)[:, None, None]
    turn = c * np.eye(3) + s * skew + (1 - c) * axes[:, :, None] * axes[:, None, :]
    matrices = np.concatenate([factors[:, None, None] * turn, places[:, :, None]], axis=2)
    boxes = rm.instances(rm.box((0.3, 0.4, 0.5)), matrices[::2])
    return boxes | rm.instances(rm.sphere(0.25), matrices[1::2])


def scene(n: int, objects: str = "auto", **more: Any) -> Any:
    """The objects from outside, under a sun with a hard shadow."""
    import raymarch as rm

    side = n ** (1 / 3)
    return rm.Scene(
        solid(n, **more),
        camera=rm.Camera(position=(0.9 * side, 0.7 * side, 1.3 * side), target=(0.0, 0.0, 0.0)),
        lights=[rm.Sun(shadow=True)],
        quality=rm.Quality(objects=objects),
    )


def measure(n: int, objects: str) -> dict[str, Any]:
    """One row of the table."""
    import raymarch as rm
    from raymarch.plan import objects as planning
    from raymarch.plan import plan
    from raymarch.shader import assemble

    rm.render(rm.Scene(rm.sphere()), size=(16, 16))  # loads the driver
    clock = time.process_time
    begin = clock()
    made = scene(n, objects)
    described = clock() - begin
    begin = clock()
    planned = plan(made, size=SIZE)
    built = clock() - begin
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20
    planning._built.clear()
    begin = clock()
    planned = plan(made, size=SIZE)
    again = clock() - begin
    text = len(assemble(planned).text())
    found: dict[str, Any] = {
        "objects": n,
        "nodes s": described,
        "build s": built,
        "again s": again,
        "textures MiB": sum(t.nbytes for t in planned.textures) / 2**20,
        "peak MiB": peak * 1024,
        "text KiB": text / 1024,
    }
    located = planned.located
    found["list"] = float(np.mean([c.cells.texels[c.cells.texels[:, 1] > 0, 1].mean() for c in located] or [0]))
    with rm.Renderer(size=SIZE) as renderer:
        begin = clock()
        frame = renderer.render(made)
        frame.color  # noqa: B018
        found["first s"] = clock() - begin
        spent = []
        for _ in range(3):
            begin = clock()
            renderer.render(made).color  # noqa: B018
            spent.append(clock() - begin)
        found["frame ms"] = 1e3 * float(np.median(spent))
        counted = renderer.render(made, outputs=("evaluations",))
        found["evaluations"] = float(counted.evaluations.mean())
        frame.image().save(f"/tmp/scale-{objects}-{n}.png") if os.environ.get("RAYMARCH_SHOW") else None
    return found


def asking_all() -> Any:
    """Brute force: the same shader with one cell whose list holds every object."""
    from raymarch.plan import cells, objects

    class Whole(cells._Builder):
        def run(self) -> Any:
            ranks = self.ranked if self.blended else np.arange(len(self.rows))
            self.size = float(np.max(self.size * self.counts))
            self.low = self.low - self.size
            self.size, self.counts = 3.0 * self.size, np.ones(3, np.int64)
            level = cells._Level(np.zeros((1, 3), np.int64), np.array([0, len(ranks)]), ranks.astype(np.int32))
            self.finest = 0
            return self.refined(np.zeros((1, 2), np.float32), level)

    objects._built.clear()
    kept, objects.build = objects.build, lambda rows, exact: Whole(rows, exact).run()
    return kept


def blended(n: int, k: float = 0.25, crop: tuple[int, int] = (24, 16)) -> dict[str, Any]:
    """n blended objects: the whole picture, and a crop of its middle against brute force and the reference.

    Software renderers end all loops of a pixel after 65,535 turns, so brute force on many objects ends too early there:
    its picture is then wrong, and its time is a lower bound.
    """
    import raymarch as rm
    from raymarch.plan import objects

    made = scene(n, k=k, nodes=True)
    near = made.replace(camera=made.camera.replace(fov=45.0 * crop[1] / SIZE[1]))
    found: dict[str, Any] = {"objects": n, "k": k}
    frames = []
    for name in ("cells", "brute force"):
        if name == "brute force":
            asking_all()
        with rm.Renderer(size=crop) as renderer:
            begin = time.process_time()
            renderer.render(near).color  # noqa: B018
            found[f"{name}: crop, first s"] = time.process_time() - begin
            begin = time.process_time()
            renderer.render(near).color  # noqa: B018
            found[f"{name}: crop ms"] = 1e3 * (time.process_time() - begin)
            frames.append(renderer.render(near, outputs=("color", "depth")))
        if name == "cells":
            with rm.Renderer(size=SIZE) as renderer:
                renderer.render(made).color  # noqa: B018
                begin = time.process_time()
                frame = renderer.render(made)
                frame.color  # noqa: B018
                found["cells: frame ms"] = 1e3 * (time.process_time() - begin)
    found["times faster"] = found["brute force: crop ms"] / found["cells: crop ms"]
    known = rm.truth(near, size=crop)
    color = np.clip(np.asarray(frames[0].color, np.float64), 0.0, 1.0)
    away = 255.0 * np.abs(color - np.clip(known.color, 0.0, 1.0)).max(axis=-1)
    hit = np.isfinite(known.depth)
    found["pixels hit"] = int(hit.sum())
    found["depth error, largest"] = float(np.max(np.abs(frames[0].depth - known.depth)[hit] / known.depth[hit]))
    found["colour off by > 1 of 255"] = int((away > 1.0).sum())
    found["largest"] = float(away.max())
    objects._built.clear()
    return found


def show(rows: list[dict[str, Any]]) -> None:
    """Print a table in Markdown."""
    names = list(rows[0])
    print("| " + " | ".join(names) + " |")
    print("|" + "---|" * len(names))
    for row in rows:
        cells = [f"{v:,}" if isinstance(v, int) else f"{v:.3g}" if v < 1000 else f"{v:,.0f}" for v in row.values()]
        print("| " + " | ".join(cells) + " |", flush=True)


def in_process(n: int, objects: str) -> dict[str, Any]:
    """`measure` in a new process."""
    environment = {**os.environ, "MESA_SHADER_CACHE_DISABLE": "true", "RAYMARCH_COMPILE_LIMIT": "1e6"}
    with tempfile.TemporaryDirectory() as cache:
        run = subprocess.run(
            [sys.executable, "-W", "ignore", "-m", "tests.lab.scale", "--one", str(n), objects],
            env={**environment, "RAYMARCH_CACHE": cache},
            capture_output=True,
            text=True,
        )
    if run.returncode:
        raise SystemExit(run.stderr)
    found: dict[str, Any] = eval(run.stdout)
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--counts", type=int, nargs="*", default=list(COUNTS))
    parser.add_argument("--text", type=int, nargs="*", default=[])
    parser.add_argument("--blend", type=int)
    parser.add_argument("--one", nargs=2, help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.blend:
        show([blended(given.blend)])
        return
    if given.one:
        print(measure(int(given.one[0]), given.one[1]))
        return
    rows = [in_process(n, "data") for n in given.counts if not given.text]
    rows += [in_process(n, "text") for n in given.text]
    show(rows)


if __name__ == "__main__":
    main()
