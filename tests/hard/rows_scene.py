"""Cases that show when the scene is built: refused, or proven."""

from __future__ import annotations

import json
from collections.abc import Iterator

import numpy as np

import raymarch as rm
from raymarch.expr.function import Function
from raymarch.expr.node import const, var
from raymarch.expr.types import FLOAT, VEC3
from raymarch.expr.vocabulary import acos, asin, atan2, pow, smoothstep, sqrt
from raymarch.plan import explain, plan
from raymarch.sdf import repeat, repeat_varied, transform
from raymarch.sdf.blends import FAMILIES, exponential_min
from raymarch.sdf.domain import Domain
from raymarch.sdf.noise import hash
from tests.hard.world import ULP, Figure, World, bytes_off, case, refusals, steepest
from tests.support.glsl_harness import evaluate
from tests.support.node_samples import USUAL, Field, definitions, usual

BOTH = (rm.box(1), rm.sphere(0.6).translate((0.4, 0.3, 0)))


@case(8, "order in a smooth chain")
def smooth_chain(world: World) -> Iterator[Figure]:
    """512 equal operands, blended one after another, would grow by nearly k. In a balanced tree they grow by k/4 per
    level, and the bounding box includes it."""
    k, ball = 0.3, rm.sphere(0.5)
    many = rm.union(*[rm.sphere(0.5 + 1e-7 * i) for i in range(512)], k=k)
    points = np.random.default_rng(0).uniform(-1.5, 1.5, (2000, 3))
    grown = float(np.max(ball.distance(points) - many.distance(points)))
    yield Figure("growth of the solid", grown, 9 * k / 4 + 6e-5, "9 levels of k/4")
    inside = points[many.distance(points) < 0]
    low, high = many.bounds
    yield Figure("reach out of its box", float(np.maximum(low - inside, inside - high).max()), 0, "the box holds it")
    parts = [rm.sphere(0.3).translate(tuple(p)) for p in points[:16]]
    apart = rm.union(*parts, k=k).distance(points) - rm.union(*parts[::-1], k=k).distance(points)
    yield Figure("change with the order of 16", float(np.abs(apart).max()), 4 * k / 4, "4 levels of k/4")


@case(9, "k is 0")
def no_blend(world: World) -> Iterator[Figure]:
    """A blend of width 0 computes 0/0 and the object vanishes. It is compiled to the plain union. A parameter may make
    it 0, but not less."""
    same = rm.union(*BOTH, k=0).glsl() == (BOTH[0] | BOTH[1]).glsl()
    yield Figure("texts that differ from the plain union", not same, 0, "no blend: the plain union")
    plain, none = (world.draw(rm.Scene(node), outputs=("color",)) for node in (BOTH[0] | BOTH[1], rm.union(*BOTH, k=0)))
    yield Figure("8-bit steps between the pictures", bytes_off(plain, none), 0, "the same text")
    points = np.random.default_rng(0).uniform(-2.0, 2.0, (2000, 3))
    apart = rm.union(*BOTH, k=rm.Param("k", 0.0, 0.0, 1.0)).distance(points) - (BOTH[0] | BOTH[1]).distance(points)
    yield Figure("distance from the plain union for a parameter of 0", float(np.abs(apart).max()), 1e-15, "its ulp")
    yield refusals((lambda: rm.union(*BOTH, k=rm.Param("k", 0.5, -0.1, 1.0)), ("k = ", "> 0")))


@case(10, "k below 0")
def negative_blend(world: World) -> Iterator[Figure]:
    """A negative width gives a wrong picture without an error. It is refused."""
    calls = [(lambda f=f: f(*BOTH, k=-0.1), ("k = -0.1", ">= 0")) for f in (rm.union, rm.intersection, rm.difference)]
    yield refusals(*calls)


@case(11, "zero or negative size")
def no_size(world: World) -> Iterator[Figure]:
    """A size of 0 or less gives an empty solid, or one turned inside out. It is refused, and the message names the
    value."""
    yield refusals(
        (lambda: rm.sphere(0), ("sphere: radius = 0", "> 0")),
        (lambda: rm.sphere(-1), ("sphere: radius = -1", "> 0")),
        (lambda: rm.box((1, 0, 1)), ("box: size", "> 0")),
        (lambda: rm.torus(1, -0.1), ("torus: minor = -0.1", "> 0")),
        (lambda: rm.cylinder(1, 0), ("cylinder: height = 0", "> 0")),
        (lambda: rm.box(1).scale(0), ("factor = 0", "> 0")),
        (lambda: rm.box(1).scale((1, -1, 1)), ("factors", "> 0")),
        (lambda: rm.box(1).shell(0), ("thickness = 0", "> 0")),
    )
    accepted = []
    for definition in definitions():
        for name, domain in definition.domains.items():
            if domain.type is FLOAT and domain.low >= 0 and domain.high > 0:
                accepted += [f"{definition.name}.{name}"] * _accepts(domain, definition.name, name, -1.0)
    yield Figure("parameters of all nodes that take -1 for a length", len(accepted), 0, "their domains begin at 0")


def _accepts(domain: Domain, node: str, name: str, value: object) -> bool:
    try:
        domain.accept(node, name, value)
    except rm.SceneError as error:
        return name not in str(error)
    return True


@case(12, "NaN or infinite parameter")
def not_a_number(world: World) -> Iterator[Figure]:
    """min() drops a NaN, so a faulty operand of a union does not change any pixel. Every number of every node is
    checked."""
    accepted, tried = [], 0
    for definition in definitions():
        for name, domain in definition.domains.items():
            if domain.type is None:
                continue
            for bad in (np.nan, np.inf, -np.inf):
                value = bad if domain.type is FLOAT else np.full(domain.type.shape, bad)
                tried += 1
                accepted += [f"{definition.name}.{name}"] * _accepts(domain, definition.name, name, value)
    yield Figure(f"accepted, of {tried}", len(accepted), 0, "every number is finite")
    yield refusals(
        (lambda: rm.sphere(np.nan), ("radius = nan", "finite")), (lambda: rm.box(1).translate((0, np.inf, 0)), ("inf",))
    )


@case(13, "exponential blend")
def exponential(world: World) -> Iterator[Figure]:
    """The sum of powers overflows at distances of 100 k. The larger term is factored out."""
    b = np.concatenate([np.linspace(-1000, 1000, 2001), [1e-30, -1e-30, 0]])
    a, k = np.full_like(b, 0.25), np.full_like(b, 1.0)
    found = evaluate(world.context, exponential_min, [a, b, k]).astype(np.float64)
    true = -0.25 * np.logaddexp2(-a / 0.25, -b.astype(np.float32) / 0.25)
    yield Figure("values that are not finite, |d| to 1,000 k", int(np.sum(~np.isfinite(found))), 0, "all are defined")
    wrong = float(np.max(np.abs(found - true) / (ULP * np.maximum(np.abs(true), 1))))
    yield Figure("largest error in ulp", wrong, 4, "a sum, a power and a logarithm")


@case(14, "power blend")
def power_blend(world: World) -> Iterator[Figure]:
    """It overflows, is NaN for negative distances and does not blend on the surface. It is not offered."""
    yield Figure("families of that name", "power" in FAMILIES, 0, "not offered")
    yield refusals((lambda: rm.union(*BOTH, k=0.1, blend="power"), ("blend = 'power'", "quadratic", "root")))


@case(15, "power of a negative base")
def negative_base(world: World) -> Iterator[Figure]:
    """pow(-1, 2) is 1 as a literal, which the compiler folds, and NaN as a uniform. The vocabulary defines one
    result."""
    x, y = var("x", FLOAT), var("y", FLOAT)
    bases = np.array([-2.0, -1.0, -0.5, 0.0, 0.5, 2.0])
    apart = 0
    for power in (0.0, 1.0, 2.0, 3.0, 0.5, -1.0):
        known = Function("known", (x,), pow(x, power))
        asked = Function("asked", (x, y), pow(x, y))
        folded = [float(pow(const(b), power).data) for b in bases]
        on_device = evaluate(world.context, known, [bases])
        of_uniform = evaluate(world.context, asked, [bases, np.full_like(bases, power)])
        # A power is exp2(power * log2(base)): the rounding of the product counts as often as it is large.
        with np.errstate(divide="ignore"):
            rounds = 1 + np.abs(power * np.log2(np.maximum(bases, np.finfo(np.float32).tiny)))
        for values in (on_device, of_uniform):
            finite = np.isfinite(folded)
            off = np.abs(values - np.where(finite, folded, 0))
            apart += int(np.sum((off > 8 * ULP * rounds * (1 + np.abs(folded)))[finite]))
    yield Figure("answers that depend on who computes them", apart, 0, "one definition, many readings")


@case(16, "off-centre child in a repetition")
def off_centre(world: World) -> Iterator[Figure]:
    """The field of the own cell overestimates the distance by up to 0.7 of a cell. The nearer neighbours are evaluated
    too."""
    for name, child in (
        ("ball aside", rm.sphere(0.2).translate((0.3, 0.1, -0.2))),
        ("capsule", rm.capsule((0, 0, 0), (0.3, 0.4, 0.2), 0.1)),
    ):
        node = repeat(child, 1.0, 5)
        points = np.random.default_rng(1).uniform(-3, 3, (4000, 3))
        cells = [np.array((i, j, k)) - 2.0 for i in range(5) for j in range(5) for k in range(5)]
        all_of_them = np.min([child.distance(points - c) for c in cells], axis=0)
        over = float(np.max(node.distance(points) - all_of_them))
        yield Figure(f"overestimate of a {name}, in cells", over, 1e-12, "never above the nearest of all copies")


@case(17, "child larger than its cell")
def too_large(world: World) -> Iterator[Figure]:
    """A solid that extends beyond its cell is cut at the border. More copies are evaluated, or the solid is refused."""
    ball, aside = rm.sphere(0.8), rm.sphere(0.4).translate((0.3, 0, 0))
    yield refusals(
        (lambda: repeat(ball, 1.0), ("sphere is 1.6 wide along x", "spacing >= 1.6")),
        (lambda: repeat_varied(lambda i: ball, 1.0), ("sphere", "0.8", "spacing >= 1.6")),
        (lambda: repeat(rm.union(ball, aside, k=0.5), 1.6), ("wide", "spacing >=")),
    )
    points = np.random.default_rng(2).uniform(-3, 3, (4000, 3))
    cells = [np.array((i, j, k)) - 2.0 for i in range(5) for j in range(5) for k in range(5)]
    true = np.min([aside.distance(points - c) for c in cells], axis=0)
    found = repeat(aside, 1.0, 5).distance(points)
    yield Figure(
        "points on the wrong side, a solid over the border", int(np.sum((found < 0) != (true < 0))), 0, "it fits"
    )


@case(18, "huge repetition index")
def huge_index(world: World) -> Iterator[Figure]:
    """fract(1e6 + 0.3) is 0.3125 in float32, and mod(-1e-9, 1) is 1. Near a border two copies are evaluated, so that
    the distance is right for either cell."""
    random = np.random.default_rng(3)
    node, p = repeat(rm.sphere(0.3), 1.0), var("p", VEC3)
    from raymarch.sdf.evaluation import lower

    borders = np.array([0.0, 1.0, 100.0, 1e4, 1e6])[random.integers(0, 5, 5000)][:, None] + 0.5
    points = (borders + random.choice([-1, 1], (5000, 3)) * 10.0 ** random.uniform(-9, -0.3, (5000, 3))).astype(
        np.float32
    )
    found = evaluate(world.context, lower(node), [points]).astype(np.float64)
    true = node.distance(points.astype(np.float64))
    wrong = np.abs(found - true) / (ULP * np.maximum(np.abs(points).max(axis=1), 1))
    yield Figure("largest error in ulp of the coordinates", float(wrong.max()), 2, "one subtraction a coordinate")
    assert p is not None


@case(19, "spacing 0")
def no_spacing(world: World) -> Iterator[Figure]:
    """A spacing of 0 divides by 0. It is refused."""
    yield refusals(
        (lambda: repeat(rm.sphere(0.1), 0), ("spacing", "> 0")),
        (lambda: repeat(rm.sphere(0.1), (1, 0, 1)), ("spacing", "> 0")),
        (lambda: repeat_varied(lambda i: rm.sphere(0.1), 0), ("spacing", "> 0")),
        (lambda: rm.sphere(0.1).polar(0), ("count = 0", "1")),
    )


@case(20, "uneven scale")
def uneven_scale(world: World) -> Iterator[Figure]:
    """Distances along the axis with the smallest factor are overestimated unless that factor scales them."""
    for node in (rm.sphere().scale((3, 0.2, 1)), rm.box(1).rotate(0.7, (1, 2, 3)).scale((0.1, 5, 1))):
        yield Figure(
            f"slope of {node.children[0].name}.scale over its promise", steepest(node), 1 + 1e-9, "1-Lipschitz"
        )


@case(21, "singular or mirroring matrix")
def matrices(world: World) -> Iterator[Figure]:
    """A singular matrix gives no field. A reflection inverts normals that are computed as cross products."""
    flat, mirror = np.diag([1.0, 0, 1, 1]), np.diag([-1.0, 1, 1, 1])
    yield refusals((lambda: transform(rm.box(1), flat), ("matrix", "invert")))
    node = transform(rm.sphere().translate((0.5, 0, 0)), mirror)
    points = np.random.default_rng(4).normal(size=(1000, 3))
    outward = points - (-0.5, 0, 0)
    outward /= np.linalg.norm(outward, axis=1, keepdims=True)
    yield Figure("error of its normals", float(np.abs(node.gradient(points) - outward).max()), 1e-12, "rounding")
    sheared = transform(rm.box(1), [[1.5, 0.4, 0, 0], [0, 0.7, 0.3, 0], [0.1, 0, -1, 0], [0, 0.4, 0, 1]])
    yield Figure("slope of a sheared one over its promise", steepest(sheared), 1 + 1e-9, "1-Lipschitz")


@case(22, "twist and bend")
def twist(world: World) -> Iterator[Figure]:
    """Both increase the slope of the field, without limit if the child is unbounded. The Lipschitz bound has a closed
    form over the bounding box."""
    brick = rm.box((1, 2, 0.5))
    for name, node in (("twist", brick.twist(2.0)), ("bend", brick.bend(0.8)), ("both", brick.twist(1.0).bend(0.5))):
        yield Figure(f"slope after {name} over its promise", steepest(node), 1 + 1e-9, "1-Lipschitz")
    k, r = 2.0, 1.0001 * float(np.hypot(0.5, 0.25))  # what is twisted reaches a ten-thousandth beyond the solid
    closed = 0.5 * (k * r + np.sqrt((k * r) ** 2 + 4))
    yield Figure(
        "divisor of the twist over the closed form",
        brick.twist(2.0).facts.divisor / closed,
        1 + 1e-12,
        "(kr + sqrt(k²r² + 4)) / 2",
    )
    yield refusals(
        (lambda: rm.plane().twist(1.0), ("twist", "bounded")),
        (lambda: rm.infinite_cylinder().bend(1.0), ("bend", "bounded")),
    )


@case(24, "ellipsoid quotient")
def ellipsoid(world: World) -> Iterator[Figure]:
    """The usual quotient of two lengths has slopes up to 25 and is 0/0 at the centre. A safe form is used."""
    node = rm.ellipsoid((1.0, 0.1, 0.6))
    yield Figure("slope over its promise", steepest(node), 1 + 1e-9, "1-Lipschitz")
    near = np.concatenate([np.zeros((1, 3)), np.eye(3) * 1e-20, -np.eye(3) * 1e-7, np.eye(3) * 1e-3])
    from raymarch.sdf.evaluation import lower

    values = evaluate(world.context, lower(node), [near])
    yield Figure("values at the centre that are not below 0", int(np.sum(~(values < 0))), 0, "the centre is inside")


@case(25, "shell of a subtraction")
def shell_of_bound(world: World) -> Iterator[Figure]:
    """The offset of a field that is only a bound is not at the requested distance. `explain` warns about it."""
    cut = rm.box(1) - rm.sphere(0.6)
    warned = sum(
        any("acts on a bound field" in w for w in plan(rm.Scene(n)).warnings) for n in (cut.shell(0.1), cut.round(0.1))
    )
    yield Figure("offsets of a bound without a warning, of 2", 2 - warned, 0, "exactness is a fact")
    quiet = plan(rm.Scene(rm.box(1).shell(0.1))).warnings
    yield Figure("warnings about an exact one", len(quiet), 0, "the offset of an exact field is exact")
    known = json.loads(json.dumps(explain.as_dict(plan(rm.Scene(cut.shell(0.1))), {})))["warnings"]
    yield Figure("warnings missing in --json", 1 - len(known), 0, "both say the same")


@case(26, "inside distances")
def inside(world: World) -> Iterator[Figure]:
    """Unions are not exact inside. The value must have the right sign and must not exceed the distance to the
    surface."""
    node = rm.box((2, 1, 1)) | rm.sphere(0.8).translate((0.5, 0.2, 0)) | rm.torus(1, 0.2)
    field, random = Field(node), np.random.default_rng(5)
    points = field.draw(random, 20000)
    values = field.value(points)
    surface = field.surface(random, points, values, 3000)
    some = points[:800]
    true = np.min(np.linalg.norm(some[:, None] - surface[None], axis=-1), axis=1)
    over = float(np.max(np.abs(values[:800]) - true))
    yield Figure("value minus the distance to the surface", over, 1e-9, "true distance to points on it")
    solid = np.min([c.distance(points) for c in node.children], axis=0) < 0
    yield Figure("wrong signs", int(np.sum((values < 0) != solid)), 0, "the sign is exact")


@case(31, "medial axis")
def medial_axis(world: World) -> Iterator[Figure]:
    """The gradient vanishes where two surfaces are equally near, and normalize(0) is NaN."""
    bad, tried = _bad_gradients(world, np.zeros((1, 3)))
    yield Figure(f"gradients at the centre that are NaN or too long, of {tried} nodes", bad, 0, "finite, and at most 1")
    inside = rm.Scene(rm.sphere(2.0), rm.Camera((0, 0, 0), (0, 0, -1)))
    frame = world.draw(inside, outputs=("color", "normal"))
    yield Figure(
        "colours seen from the centre of a ball that are not finite",
        int(np.sum(~np.isfinite(frame.color))),
        0,
        "all are",
    )


@case(32, "root of 0")
def root_of_zero(world: World) -> Iterator[Figure]:
    """The derivative of a square root is infinite at 0: on edges, axes and corners."""
    grid = np.stack(np.meshgrid(*[[-1.0, -0.5, 0.0, 0.25, 0.5]] * 3), axis=-1).reshape(-1, 3)
    bad, tried = _bad_gradients(world, grid)
    yield Figure(f"gradients on a grid that are NaN or too long, of {tried}", bad, 0, "finite, and at most 1")


def _bad_gradients(world: World, points: np.ndarray) -> tuple[int, int]:
    """In float32, of every shape of the package with its defaults, on the device for some."""
    from raymarch.expr.arrays import evaluator
    from raymarch.expr.derivative import companion
    from raymarch.sdf.evaluation import lower

    bad = tried = 0
    for definition in definitions():
        given = definition.defaults.keys() | USUAL.get(definition.name, {}).keys()
        if definition.arity != "none" or definition.dimension != 3 or given != definition.domains.keys():
            continue
        node = usual(definition)
        whole = companion(lower(node))
        single = evaluator([whole.body], whole.params, np.float32)(points.astype(np.float32))[0]
        slope = np.linalg.norm(np.broadcast_to(single, (len(points), 4))[:, :3].astype(np.float64), axis=1)
        most = np.inf if node.exactness == "estimate" else 1 + 1e-4
        bad += int(np.sum(~(np.isfinite(slope) & (slope <= most))))
        tried += len(points)
    return bad, tried


@case(33, "arguments a hair out of range")
def clamped(world: World) -> Iterator[Figure]:
    """acos(1 + ulp) and sqrt(-1e-8) are NaN. The vocabulary clamps arguments."""
    x = var("x", FLOAT)
    edge = np.array([1 + ULP, -1 - ULP, 1.5, -1.5, 1.0, -1.0, 0.0, -1e-8, -1.0, -1e-38])
    bad = 0
    for operation in (acos, asin, sqrt):
        values = evaluate(world.context, Function("edge", (x,), operation(x)), [edge])
        bad += int(np.sum(~np.isfinite(values)))
        bad += int(np.sum(~np.isfinite([operation(const(float(e))).data for e in edge])))
    yield Figure("values that are not finite, on the device and folded", bad, 0, "arguments are clamped")


@case(34, "undefined angles and steps")
def undefined(world: World) -> Iterator[Figure]:
    """atan(0, 0) and smoothstep with equal edges are undefined in GLSL."""
    x, y = var("x", FLOAT), var("y", FLOAT)
    values = evaluate(world.context, Function("angle", (y, x), atan2(y, x)), [[0, 0, -0.0, 1e-38], [0, -0.0, 0, 0]])
    yield Figure("angles at the pole that are not finite", int(np.sum(~np.isfinite(values))), 0, "defined as 0")
    from raymarch.sdf.evaluation import lower

    axis = np.array([(0, h, 0) for h in np.linspace(-1, 1, 21)])
    polar = rm.box(0.3).translate((0.8, 0, 0)).polar(5)
    found = evaluate(world.context, lower(polar), [axis])
    yield Figure(
        "error of a polar repetition on its axis",
        float(np.abs(found - polar.distance(axis)).max()),
        8 * ULP,
        "rounding",
    )
    yield refusals((lambda: smoothstep(1.0, 1.0, x), ("smoothstep", "1")))


@case(37, "hash by sines")
def hashes(world: World) -> Iterator[Figure]:
    """fract(sin(x) * 43758) is chaotic in the last bit and differs between drivers. Hashes are computed from
    integers."""
    p = var("p", VEC3)
    cells = np.random.default_rng(6).integers(-5000, 5000, (4000, 3)).astype(np.float64)
    from raymarch.expr.arrays import evaluator

    function = Function("hash", (p,), hash(p))
    found = evaluate(world.context, function, [cells]).astype(np.float64)
    true = evaluator([function.body], [p])(cells)[0]
    yield Figure("hashes of 4,000 that differ in a bit", int(np.sum(found != true)), 0, "integers are exact")
    yield Figure(
        "distance of their mean from 1/2, in standard errors",
        abs(found.mean() - 0.5) * np.sqrt(12 * 4000),
        4,
        "uniform",
    )


@case(49, "degenerate camera")
def degenerate_camera(world: World) -> Iterator[Figure]:
    """A camera without a direction, an up vector or a field of view has no picture."""
    yield refusals(
        (lambda: rm.Camera((0, 1, 0), (0, 0, 0), up=(0, 1, 0)), ("Camera", "parallel")),
        (lambda: rm.Camera((1, 1, 1), (1, 1, 1)), ("Camera: position = target",)),
        (lambda: rm.Camera(fov=0), ("fov = 0", "between 0 and 180")),
        (lambda: rm.Camera(fov=180), ("fov = 180", "between 0 and 180")),
        (lambda: rm.Camera((np.nan, 0, 0), (0, 0, 0)), ("Camera: position", "finite")),
        (lambda: rm.Camera((0, 0, 3), (0, 0, 0), up=(0, 0, 0)), ("Camera: up",)),
    )


@case(51, "a very large graph")
def large_graph(world: World) -> Iterator[Figure]:
    """Chains of operators overflow Python's stack, and compilers take seconds for a thousand shapes."""
    node: rm.Node = rm.sphere(0.1)
    for i in range(3000):
        node = node | rm.sphere(0.1).translate((0.01 * (i % 100), 0, 0))
    yield Figure(
        "error of a chain of 3,000 unions", abs(float(node.distance([(3.0, 0, 0)])[0]) - 1.91), 1e-12, "no recursion"
    )
    shaken = rm.union(*[rm.sphere(0.1).translate((0.1 * i, 0.01 * (i % 7), 0)) for i in range(1100)])
    yield refusals((lambda: plan(rm.Scene(shaken, quality=rm.Quality(objects="text"))), ("1100 shapes", "1024")))
