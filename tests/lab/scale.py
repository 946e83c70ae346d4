"""Measure scenes of many objects: build, memory, text, first frame and frame, against the number of objects.

python -m tests.lab.scale                     the table of docs/scale.md
python -m tests.lab.scale --counts 32 2048    some numbers of objects
python -m tests.lab.scale --text 8 32 128     the same scenes with all objects as text
python -m tests.lab.scale --blend 6000        blended objects, against brute force on crops
python -m tests.lab.scale --reference 5000    the float64 reference
python -m tests.lab.scale --arranged 20000    lines, planes, shells, clusters and groups far apart

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
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, TypeAlias
from unittest import mock

import numpy as np
from numpy.typing import NDArray

from tests.support.arrangements import ARRANGEMENTS

Array: TypeAlias = NDArray[np.float64]

COUNTS = (8, 32, 128, 512, 2048, 10_000, 100_000)
SIZE = (640, 360)
AS_NODES = 2048
"""Up to this number the objects are nodes of a union; above it they are instances of two nodes."""
TURNS, LEAST_STEPS = 65_535, 4
"""Turns of all loops of a pixel in llvmpipe, and the least `Quality.steps_per_pass`."""


class Drawn:
    """n random boxes and spheres, one to a unit cube on average: places (n, 3), sizes relative to 1, and rotations."""

    def __init__(self, n: int, seed: int = 0) -> None:
        rng = np.random.default_rng(seed)
        side = n ** (1 / 3)
        self.places = rng.uniform(0.0, side, (n, 3)) - side / 2
        self.axes = rng.normal(size=(n, 3))
        self.angles = rng.uniform(0.0, np.pi, n)
        self.factors = rng.uniform(0.6, 1.4, n)

    @property
    def rotations(self) -> Array:
        """Matrices for column vectors, shape (n, 3, 3)."""
        axes = self.axes / np.linalg.norm(self.axes, axis=1, keepdims=True)
        skew = np.zeros((len(axes), 3, 3))
        skew[:, 0, 1], skew[:, 0, 2], skew[:, 1, 2] = -axes[:, 2], axes[:, 1], -axes[:, 0]
        skew -= np.swapaxes(skew, 1, 2)
        c, s = np.cos(self.angles)[:, None, None], np.sin(self.angles)[:, None, None]
        return c * np.eye(3) + s * skew + (1 - c) * axes[:, :, None] * axes[:, None, :]

    def blend(self, points: Array, k: float) -> Array:
        """The blend of all objects at points (m, 3), in float64: each object is evaluated at each point."""
        columns = np.ascontiguousarray(points.T)
        row = []
        for i, (place, turn, factor) in enumerate(zip(self.places, self.rotations, self.factors, strict=True)):
            away = columns - place[:, None]
            if i % 2:
                row.append(np.sqrt((away * away).sum(axis=0)) - 0.25 * factor)
            else:
                q = np.abs(turn.T @ away) - 0.5 * factor * np.array([[0.3], [0.4], [0.5]])
                outside = np.maximum(q, 0.0)
                row.append(np.sqrt((outside * outside).sum(axis=0)) + np.minimum(q.max(axis=0), 0.0))
        while len(row) > 1:
            row = [smooth_min(*row[i : i + 2], k) if i + 1 < len(row) else row[i] for i in range(0, len(row), 2)]
        return row[0]


def smooth_min(a: Array, b: Array, k: float) -> Array:
    """The quadratic smooth minimum."""
    h = np.maximum(k - np.abs(a - b), 0.0) / k
    return np.minimum(a, b) - 0.25 * k * h * h


def solid(n: int, k: float = 0.0, seed: int = 0, nodes: bool | None = None) -> Any:
    """The objects of `Drawn`, as nodes or as instances."""
    import raymarch as rm

    drawn = Drawn(n, seed)
    places, factors = drawn.places, drawn.factors
    if nodes if nodes is not None else n <= AS_NODES:
        made = []
        for i in range(n):
            if i % 2:
                made.append(rm.sphere(0.25 * factors[i]).translate(places[i]))
            else:
                box = rm.box((0.3 * factors[i], 0.4 * factors[i], 0.5 * factors[i]))
                made.append(box.rotate(drawn.angles[i], drawn.axes[i]).translate(places[i]))
        return rm.union(*made, k=k)
    matrices = np.concatenate([factors[:, None, None] * drawn.rotations, places[:, :, None]], axis=2)
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


def measure_arranged(name: str, n: int, k: float) -> dict[str, Any]:
    """Peak memory and CPU time of spheres at uneven places, and a picture of 32x18 pixels of some of them."""
    import raymarch as rm
    from raymarch.plan import plan
    from tests.support.arrangements import RADIUS, arranged

    def peak() -> float:
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**10

    rm.render(rm.Scene(rm.sphere()), size=(16, 16))  # loads the driver
    clock, before = time.process_time, peak()
    places = arranged(name, n)
    begin = clock()
    node = rm.union(*[rm.sphere(RADIUS).translate(place) for place in places], k=k)
    made = rm.Scene(node, camera=rm.Camera(position=places[0] + np.array([1.0, 2.0, 3.0]), target=places[0]))
    found: dict[str, Any] = {"arrangement": name, "objects": n, "k": k, "nodes s": clock() - begin}
    found["nodes MiB"] = peak() - before
    begin = clock()
    planned = plan(made, size=SIZE)
    found["plan s"] = clock() - begin
    found["plan MiB"] = peak() - before - found["nodes MiB"]
    found["longest list"] = planned.located[0].cells.most
    begin = clock()
    with rm.Renderer(size=(32, 18)) as renderer:
        found["evaluations"] = float(renderer.render(made).evaluations.mean())
    found["picture s"] = clock() - begin
    return found


def asking_all() -> Any:
    """Brute force: the same shader with one cell whose list holds every object."""
    from raymarch.plan import cells, lists, objects

    class Whole(cells.Builder):
        def run(self) -> Any:
            ranks = self.ranked if self.blended else np.arange(len(self.rows))
            self.size = float(np.max(self.size * self.counts))
            self.low = self.low - self.size
            self.size, self.counts = 3.0 * self.size, np.ones(3, np.int64)
            level = lists.Level(np.zeros((1, 3), np.int64), np.array([0, len(ranks)]), ranks.astype(np.int32))
            self.finest = 0
            return self.refined(np.zeros((1, 2), np.float32), level)

    objects._built.clear()
    kept, objects.build = objects.build, lambda rows, exact: Whole(rows, exact).run()
    return kept


@contextmanager
def reference(n: int, k: float) -> Iterator[Callable[[Any], Any]]:
    """The float64 reference of a scene of blended objects: a scene whose field is evaluated in NumPy arrays.

    Inside, `rm.truth` of what the given function returns evaluates `Drawn.blend`. The node of that scene only has the
    box of the objects.
    """
    import raymarch as rm
    from raymarch.truth import tracer
    from raymarch.truth.field import Field

    drawn, step = Drawn(n), 1e-6

    class Blend(Field):
        def distance(self, points: Array) -> Array:
            return drawn.blend(points, k)

        rest = distance

        def gradient(self, points: Array) -> Array:
            offsets = step * np.concatenate([np.eye(3), -np.eye(3)])
            values = drawn.blend((points + offsets[:, None, :]).reshape(-1, 3), k).reshape(6, -1)
            return ((values[:3] - values[3:]) / (2.0 * step)).T

    def boxed(scene: Any) -> Any:
        low, high = scene.node.bounds
        return scene.replace(node=rm.box(tuple(high - low)).translate(tuple(0.5 * (low + high))))

    with mock.patch.object(tracer, "Field", Blend):
        yield boxed


def blended(n: int, k: float = 0.25, crop: tuple[int, int] = (12, 8)) -> dict[str, Any]:
    """n blended objects: the whole picture, and a crop of its middle against brute force and the reference.

    Software renderers end all loops of a pixel after `TURNS` turns. So brute force marches a few steps in each pass,
    and times are compared without shadows, whose rays are not divided into passes. With more than 3,640 objects the
    least number of steps takes too many turns: the picture of brute force is wrong then, and its time a lower bound.
    """
    import raymarch as rm
    from raymarch.plan import objects

    made = scene(n, k=k, nodes=True)
    near = made.replace(camera=made.camera.replace(fov=45.0 * crop[1] / SIZE[1]))
    unshadowed = near.replace(lights=[rm.Sun()])
    steps = TURNS // (3 * n) - 2  # a turn for each object, for each fold, and for the end of each loop over folds
    passes = unshadowed.replace(quality=near.quality.replace(steps_per_pass=max(LEAST_STEPS, steps)))
    found: dict[str, Any] = {"objects": n, "k": k}

    def timed(scene: Any, size: tuple[int, int]) -> tuple[float, Any]:
        print(f"{sum(os.times()[:2]):.0f} s", file=sys.stderr)
        with rm.Renderer(size=size) as renderer:
            renderer.render(scene).color  # noqa: B018
            begin = time.process_time()
            renderer.render(scene).color  # noqa: B018
            return 1e3 * (time.process_time() - begin), renderer.render(scene, outputs=("color", "depth"))

    found["cells: frame ms"], _ = timed(made, SIZE)
    _, shadowed = timed(near, crop)
    color, depth = shadowed.color, shadowed.depth
    found["cells: crop ms"], fast = timed(unshadowed, crop)
    kept = asking_all()
    found["brute force: crop ms"], slow = timed(passes, crop)
    objects.build = kept
    objects._built.clear()
    found["times faster"] = found["brute force: crop ms"] / found["cells: crop ms"]
    known = steps >= LEAST_STEPS
    found["largest difference of 255 from brute force"] = largest(fast.color, slow.color) if known else np.nan
    print(f"{sum(os.times()[:2]):.0f} s: reference", file=sys.stderr)
    with reference(n, k) as boxed:
        truth = rm.truth(boxed(near), size=crop)
        truth_color = truth.color
    hits = np.isfinite(truth.depth), np.isfinite(depth)
    both, alike = hits[0] & hits[1], hits[0] == hits[1]
    found["pixels hit"] = int(hits[0].sum())
    found["depth error"] = float(np.max(np.abs(depth - truth.depth)[both] / truth.depth[both]))
    found["largest difference of 255 from the reference"] = largest(color[alike], truth_color[alike])
    found["hits that differ"] = int((~alike).sum())
    found["at most so many pixels from the surface"] = grazing(shadowed.pose, Drawn(n), k, depth, truth.depth)
    return found


def grazing(pose: Any, drawn: Drawn, k: float, *depths: Array) -> float:
    """The largest distance in pixels at which rays pass the surface that hit it in one of two pictures only."""
    found, depth = 0.0, np.fmin(*depths)
    rows, columns = np.nonzero(np.isfinite(depths[0]) != np.isfinite(depths[1]))
    width = 2.0 * pose.tan_half_fov / len(depth)
    for row, column in zip(rows, columns, strict=True):
        direction = pose.directions(np.array([column]), np.array([[row]]), depth.shape[::-1]).reshape(3)
        t, reach = depth[row, column], 4.0 * width * depth[row, column]
        for _ in range(6):  # the ray is closest to the surface near the hit
            samples = np.linspace(t - reach, t + reach, 401)
            values = drawn.blend(pose.position + samples[:, None] * direction, k)
            t, reach = samples[np.argmin(values)], 0.1 * reach
        found = max(found, float(values.min() / (width * t)))
    return found


def largest(a: Array, b: Array) -> float:
    """The largest difference of two pictures, of 255 levels of linear light."""
    return float(255.0 * np.abs(np.clip(a, 0.0, 1.0) - np.clip(b, 0.0, 1.0)).max())


def traced(n: int, k: float = 0.0, size: tuple[int, int] = (64, 36)) -> dict[str, Any]:
    """CPU seconds of the float64 reference of n objects, and the pairs of a point and an object that its depth asks."""
    import raymarch as rm
    from raymarch.truth.large import _Operands

    made, pairs, ask = scene(n, k=k, nodes=n <= 5000), [0], _Operands.ask

    def counted(operands: Any, points: Array, objects: Any) -> Any:
        pairs[0] += len(points)
        return ask(operands, points, objects)

    start = time.process_time()
    with mock.patch.object(_Operands, "ask", counted):
        found = rm.truth(made, size, outputs=("depth",))
    row = {"objects": n, "k": k, "depth s": time.process_time() - start}
    row["objects a point"] = pairs[0] / int(found.evaluations.sum())
    for name in ("normal", "material", "color"):
        start = time.process_time()
        getattr(found, name)
        row[f"{name} s"] = time.process_time() - start
    return row


def written(value: float) -> str:
    return f"{value:,}" if isinstance(value, int) else f"{value:.3g}" if value < 1000 else f"{value:,.0f}"


def show(rows: list[dict[str, Any]]) -> None:
    """Print a table in Markdown."""
    names = list(rows[0])
    print("| " + " | ".join(names) + " |")
    print("|" + "---|" * len(names))
    for row in rows:
        cells = [v if isinstance(v, str) else written(v) for v in row.values()]
        print("| " + " | ".join(cells) + " |", flush=True)


def in_process(*arguments: object) -> dict[str, Any]:
    """`measure` or `measure_arranged` in a new process."""
    environment = {**os.environ, "MESA_SHADER_CACHE_DISABLE": "true", "RAYMARCH_COMPILE_LIMIT": "1e6"}
    with tempfile.TemporaryDirectory() as cache:
        run = subprocess.run(
            [sys.executable, "-W", "ignore", "-m", "tests.lab.scale", "--one", *map(str, arguments)],
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
    parser.add_argument("--reference", type=int, nargs="*")
    parser.add_argument("--arranged", type=int)
    parser.add_argument("--one", nargs="+", help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.blend:
        show([blended(given.blend)])
        return
    if given.reference:
        show([traced(n, k) for n in given.reference for k in ((0.0, 0.25) if n <= 5000 else (0.0,))])
        return
    if given.one:
        name, *numbers = given.one
        if name.isdigit():
            print(measure(int(name), *numbers))
        else:
            print(measure_arranged(name, int(numbers[0]), float(numbers[1])))
        return
    if given.arranged:
        show([in_process(name, given.arranged, k) for name in ARRANGEMENTS for k in (0.0, 0.005)])
        return
    rows = [in_process(n, "data") for n in given.counts if not given.text]
    rows += [in_process(n, "text") for n in given.text]
    show(rows)


if __name__ == "__main__":
    main()
