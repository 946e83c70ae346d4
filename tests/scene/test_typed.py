"""Expressions as newcomers from other tools type them: each is accepted, warned of, or told what to write instead."""

from __future__ import annotations

import math
import warnings
from typing import Any

import numpy as np
import pytest

import raymarch as rm

BLENDER = """
rm.cube() | rm.box((1, 1, 1))
rm.uv_sphere() | rm.sphere(1)
rm.ico_sphere() | rm.sphere(1)
rm.donut() | rm.torus
rm.sphere().location((0, 1, 0)) | translate
rm.sphere().rotation(90) | rotate
rm.sphere().scale(2, 2, 2) | scale((2, 2, 2))
rm.sphere().hide() | visible
rm.sphere().modifiers | legal
rm.PointLight((0, 3, 0), energy=100) | 'intensity'
rm.PointLight((0, 3, 0), power=100) | 'intensity'
rm.SphereLight((0, 3, 0), size=1) | 'radius'
rm.AreaLight() | rm.RectLight
rm.Sun(angle=.1) | 'softness'
rm.Sun(strength=3) | 'intensity'
rm.SpotLight((0, 3, 0), angle=.5) | 'half_angle'
rm.SpotLight((0, 3, 0), spot_size=.5) | 'half_angle'
rm.PointLight((0, 3, 0), radius=.5) | =
rm.box(size=2) | =
rm.Material(base_color="red") | 'color'
rm.Material(metallic=1) | 'metalness'
rm.Material(emit=1) | 'emission'
rm.Material(alpha=.5) | 'transmission'
rm.Material(specular=.5) | =
rm.PrincipledBSDF() | rm.Material
rm.Camera(lens=50) | legal
rm.Camera(fov=math.radians(50)) | !math.degrees(0.872665)
rm.Camera(clip_start=.1) | legal
rm.noise(scale=5) | needs 'a'
rm.world | help(raymarch)
rm.text("abc", size=1) | 'height'
rm.text("abc").extrude(depth=1) | 'height'
rm.sphere().bevel(.1) | .round(radius)
rm.box(1).bevel(.1) | .round(radius)
rm.sphere().solidify(.1) | shell
rm.sphere().subsurf() | legal
rm.sphere().array(3) | repeat
rm.sphere().boolean(rm.box(1)) | union
"""

SHADERTOY = """
rm.sdSphere(1) | rm.sphere
rm.sdBox((1, 1, 1)) | rm.box
rm.sdTorus(1, .2) | rm.torus
rm.sdPlane() | rm.plane
rm.sdCapsule((0, 0, 0), (0, 1, 0), .1) | rm.capsule
rm.sdCylinder(1, 2) | rm.cylinder
rm.sdRoundBox((1, 1, 1), .1) | rm.rounded_box
rm.sdBoxFrame((1, 1, 1), .1) | rm.box_frame
rm.opUnion(rm.sphere(), rm.box(1)) | a | b
rm.opSmoothUnion(rm.sphere(), rm.box(1), .2) | rm.union(a, b, k=0.2)
rm.opSubtraction(rm.sphere(), rm.box(1)) | a - b
rm.opIntersection(rm.sphere(), rm.box(1)) | a & b
rm.smin(rm.sphere(), rm.box(1), .2) | rm.union(a, b, k=0.2)
rm.opRep(rm.sphere(), 2) | repeat
rm.opTwist(rm.box(1), 2) | twist
rm.opRound(rm.box(1), .1) | round
rm.opOnion(rm.box(1), .1) | shell
rm.iTime | rm.time
rm.iResolution | size
rm.iMouse | rm.Param
rm.fragCoord | help(raymarch)
rm.vec3(1, 2, 3) | =
rm.mix(0, 1, .5) | =
rm.saturate(2) | rm.clamp
rm.fract(1.5) | =
rm.radians(3) | math.radians
rm.degrees(3) | math.degrees
rm.clip(3, 0, 1) | rm.clamp
rm.pow(2, 3) | =
rm.inversesqrt(2) | rm.sqrt
rm.reflect((0, 1, 0), (1, 0, 0)) | dot
rm.mat3(1) | transform
rm.dFdx(1) | help(raymarch)
rm.texture("a.png") | rm.planar
rm.min(rm.sphere(), rm.box(1)) | a | b
rm.max(rm.sphere(), rm.box(1)) | a & b
rm.abs(rm.sphere()) | shell
"""

OPENSCAD = """
rm.cube(size=2) | rm.box
rm.cube([1, 2, 3], center=True) | rm.box
rm.cylinder(h=2, r=1) | 'height'
rm.cylinder(r1=1, r2=.5, height=2) | 'radius'
rm.cylinder(d=2) | 'radius'
rm.sphere(d=2) | radius
rm.sphere(r=2) | 'radius'
rm.cylinder(2, .5).rotate([90, 0, 0]) | rotate(0.5, "y")
rm.translate((1, 0, 0)) | node.translate
rm.rotate(.4, "y") | node.rotate
rm.hull([rm.sphere(), rm.torus()]) | two balls
rm.minkowski(rm.sphere(), rm.box(1)) | offset
rm.linear_extrude(2) | extrude
rm.rotate_extrude() | revolve
rm.square(2) | rm.rectangle
rm.circle(r=2) | 'radius'
rm.polygon(points=[(0, 0), (1, 0), (0, 1)]) | =
rm.projection(rm.box(1)) | help(raymarch)
rm.color("red") | #ff8800
rm.sphere().mirror([1, 0, 0]) | =
rm.sphere().resize((1, 2, 3)) | scale
rm.sphere().multmatrix(1) | transform
rm.import_("a.stl") | rm.mesh
rm.surface("a.png") | rm.heightmap
rm.render(rm.sphere(), file="a.png") | legal
rm.difference() | one node or more
rm.difference(rm.box(1), rm.sphere()) | =
rm.sphere(-1) | a number > 0
rm.sphere(0) | a number > 0
"""

FOGLEMAN = """
rm.sphere(1) & rm.box(1.5) | =
rm.sphere(1).k(.1) | k=
rm.rounded_box(1, .1) | =
rm.wireframe_box(1, .1) | rm.box_frame
rm.capped_cylinder((0, 0, 0), (0, 1, 0), 1) | rm.cylinder
rm.capped_cone((0, 0, 0), (0, 1, 0), 1, .5) | rm.cone
rm.rounded_cone(1, .5, 2) | rm.round_cone
rm.slab(y0=0) | thickness
rm.sphere().orient((1, 0, 0)) | =
rm.box(1).twist(math.pi / 2) | =
rm.box(1).twist(90) | !math.radians(90)
rm.box(1).bend(90) | !math.radians(90)
rm.box(1).bend_linear((0, 0, 0), (1, 0, 0), (0, 1, 0)) | bend
rm.box(1).elongate((.25, .5, .75)) | =
rm.sphere().shell(.1) | =
rm.sphere().dilate(.1) | offset
rm.sphere().erode(.1) | offset
rm.sphere().circular_array(8) | polar
rm.sphere().repeat(3, (1, 1, 0)) | integers >= 1
rm.sphere().repeat(2, padding=1) | =
rm.sphere().blend(rm.box(1)) | union(other, k=0.2)
rm.circle(1).extrude(2) | =
rm.circle(1).extrude_to(rm.rectangle((1, 1)), 2) | =
rm.circle(1).revolve(2) | =
rm.sphere().save("a.stl") | rm.export(node
rm.sphere().generate() | rm.triangulate
rm.image("nothing.png") | cannot read
rm.sphere().translate(1) | 3
rm.X | lambda p
rm.UP | help(raymarch)
rm.ORIGIN | help(raymarch)
-rm.sphere() | complement
~rm.sphere() | complement
+rm.sphere() | itself
abs(rm.sphere()) | shell
rm.sphere() | rm.box(1) | =
rm.sphere() & rm.box(1) - rm.cylinder() | =
"""

THREE = """
rm.SphereGeometry(1) | rm.sphere
rm.BoxGeometry(1, 1, 1) | rm.box
rm.TorusGeometry(1, .2) | rm.torus
rm.MeshStandardMaterial(color="red") | rm.Material
rm.MeshBasicMaterial(color="red") | rm.Material
rm.DirectionalLight() | rm.Sun
rm.AmbientLight() | rm.Sky
rm.HemisphereLight() | rm.Sky
rm.PerspectiveCamera(45) | rm.Camera
rm.OrthographicCamera() | rm.Camera
rm.Camera(position=(0, 0, 5), lookAt=(0, 0, 0)) | 'target'
rm.Camera(position=(0, 0, 5), look_at=(0, 0, 0)) | 'target'
rm.Camera((0, 0, 5), (0, 0, 0), aspect=2) | legal
rm.Camera((0, 0, 5), (0, 0, 5)) | two different points
rm.Vector3(1, 2, 3) | rm.vec3
rm.Color("red") | "#ff8800"
rm.Scene().add(rm.sphere()) | node
rm.Scene(rm.sphere(), background="black") | 'sky'
rm.Scene(rm.sphere(), fog=.1) | Fog
rm.Scene(rm.sphere(), light=[rm.Sun()]) | 'lights'
rm.Scene(rm.sphere(), lights=rm.Sun()) | a list
rm.Scene([rm.sphere()]) | rm.union(*nodes)
rm.Scene(rm.sphere(), rm.box(1)) | Camera
rm.Scene(rm.sphere(), objects=3) | node
rm.Scene(rm.sphere(), samples=4) | Quality(samples=
rm.Scene(rm.sphere(), tonemapping="aces") | tone
rm.Scene(rm.sphere(), exposure=2) | tone
rm.Scene(rm.sphere(), post=rm.Bloom()) | a list
rm.PointLight((0, 3, 0), cutoff=3) | 'range'
rm.PointLight((0, 3, 0), distance=3) | legal
rm.PointLight((0, 3, 0), castShadow=True) | 'shadow'
rm.SpotLight((0, 3, 0), (0, -1, 0), 45) | <= 3.14159
rm.ImageSky("a.hdr", rotation=1) | cannot read
rm.WebGLRenderer() | rm.Renderer
rm.sphere().position((0, 1, 0)) | translate
rm.sphere().rotateX(1) | rotate(angle, "x")
rm.sphere().clone() | nodes do not change
rm.sphere().geometry | legal
rm.Material("red", roughness=2) | <= 1
rm.Material(color=(255, 0, 0)) | <= 1
rm.Material(color=0xff0000) | 3
rm.Material(color="rad") | red
rm.Material(opacity=.5) | 'transmission'
rm.Material(normalMap="a.png") | 'normal'
rm.Material(wireframe=True) | legal
"""

NUMPY = """
rm.sphere(np.float64(1)) | =
rm.sphere(np.array(1.0)) | =
rm.sphere(radius=np.array([1, 2])) | a number > 0
rm.sphere(radius="1") | a number > 0
rm.sphere(radius=None) | a number > 0
rm.sphere(radius=float("nan")) | a number > 0
rm.sphere(radius=math.inf) | a number > 0
rm.sphere(True) | is a bool
rm.box(1, 2, 3) | box((1, 2, 3))
rm.box([1, 2, 3]) | =
rm.box(np.array([1, 2, 3])) | =
rm.box((1, 2)) | 3
rm.box(sizes=(1, 2, 3)) | 'size'
rm.sphere().translate([1, 0, 0]) | =
rm.sphere().translate(1, 0, 0) | translate((1, 0, 0))
rm.sphere().translate((1, 0)) | 3
rm.sphere().translate(x=1) | legal
rm.sphere() + rm.box(1) | a | b
rm.sphere() + (1, 0, 0) | translate
rm.sphere() * 2 | scale
2 * rm.sphere() | scale
rm.sphere() / 2 | scale
rm.sphere() ** 2 | a & b
rm.sphere() @ np.eye(3) | transform
rm.sphere() - .1 | two nodes
rm.sphere() and rm.box(1) | a & b
rm.sphere() or rm.box(1) | a | b
not rm.sphere() | complement
max(rm.sphere(), rm.box(1)) | a & b
min(rm.sphere(), rm.box(1)) | a | b
sorted([rm.sphere(), rm.box(1)]) | a | b
sum([rm.sphere(), rm.box(1)]) | a | b
rm.union([rm.sphere(), rm.box(1)]) | union(*nodes)
rm.union(rm.sphere(), 3) | nodes
rm.union() | one node or more
rm.union(rm.sphere(), rm.box(1), smooth=.1) | 'k'
rm.union(rm.sphere(), rm.box(1), k=-1) | >= 0
rm.union(rm.sphere(), rm.box(1), k=.1, blend="smooth") | 'quadratic'
rm.sphere().union(rm.box(1), .1) | k=0.1
rm.sphere().distance((0, 0, 0)) | =
rm.sphere().distance([(0, 0, 0), (1, 1, 1)]) | =
rm.sphere().distance(3) | (N, 3)
rm.sphere().sdf((0, 0, 0)) | distance
rm.sphere().normal((1, 0, 0)) | gradient
rm.sphere().volume() | rm.triangulate
rm.sphere().bbox | bounds
rm.linspace(0, 1, 3) | numpy
rm.arctan2(1, 2) | rm.atan2
rm.norm((1, 2, 3)) | rm.length
rm.random() | rm.hash
rm.sin(np.linspace(0, 1, 3)) | =
rm.sin("x") | number
rm.time + 1 | =
float(rm.time) | .
rm.time > 1 and rm.time < 2 | &
rm.Param("a", 1, 0, 2) * 2 | =
rm.Param("a", 3, 0, 2) | 2
rm.Param(1, 2) | letter
rm.Param("a") | value
rm.instances(rm.sphere(.1), np.zeros((3, 2))) | (N, 3)
rm.heightmap(np.zeros(3)) | shape
rm.render(rm.sphere(), size=64) | (640, 360)
rm.render(rm.sphere(), (64, 36), quality=3) | Quality
rm.render(rm.sphere(), (64, 36), spp=4) | 'samples'
rm.render(3) | a Scene or a solid
rm.render([rm.sphere()]) | a Scene or a solid
rm.Quality("fine") | rm.Quality.preset('fine')
rm.Quality(samples=0) | 1
rm.Quality(aa=4) | 'samples'
rm.Quality(max_iterations=4) | 'max_steps'
rm.plan(rm.sphere()) | raymarch explain
rm.cost(rm.sphere()) | raymarch cost
"""

SLIPS = """
rm.shpere() | rm.sphere
rm.spere() | rm.sphere
rm.Sphere() | rm.sphere
rm.tours() | rm.torus
rm.bix() | rm.box
rm.cylindre() | rm.cylinder
rm.cilinder() | rm.cylinder
rm.elipsoid() | rm.ellipsoid
rm.capusle() | rm.capsule
rm.smoothunion(rm.box(1), rm.sphere()) | rm.union
rm.camera((0, 0, 1)) | rm.Camera
rm.material("red") | node.material
rm.scene(rm.sphere()) | rm.Scene
rm.quality() | rm.Quality
rm.sun() | rm.Sun
rm.sphere().tranlsate((1, 0, 0)) | translate
rm.sphere().traslate((1, 0, 0)) | translate
rm.sphere().rotat(1) | rotate
rm.sphere().shel(.1) | shell
rm.sphere().mirorr("x") | mirror
rm.sphere().repaet(1) | repeat
rm.sphere(radus=1) | 'radius'
rm.torus(majr=1) | 'major'
rm.box(siz=1) | 'size'
rm.cylinder(heigth=1) | 'height'
rm.sphere().scale(factr=2) | 'factor'
rm.sphere().rotate(angel=1) | 'angle'
rm.mesh("a.stl", size=2) | 'extent'
rm.plane(height=1) | 'offset'
rm.stripes("red", "blue", size=1) | 'width'
rm.box(1).twist(rm.sphere(), rate=2) | 'rate' twice
rm.sphere().rotate(45) | !math.radians(45)
rm.sphere().rotate(90, "y") | !math.radians(90)
rm.sphere().rotate("y", 1) | rotate(0.5, "y")
rm.sphere().rotate(1, "w") | 'x'
rm.sphere().mirror("w") | 'x'
rm.sphere().repeat(0) | > 0
rm.sphere().polar(0) | from 1
rm.sphere().shell(-1) | > 0
rm.sphere().round(-1) | >= 0
rm.torus(1, 2) | minor <= major
rm.rounded_box((1, 1, 1), .7) | half the smallest
rm.Sun((0, 0, 0)) | not all zero
rm.Sun(intensity=-1) | >= 0
rm.sphere().material("red") | rm.Material(color=...)
rm.sphere().material(color="red") | rm.Material(color=...)
rm.Scene(rm.sphere(), sky="blue") | =
rm.Scene(rm.sphere(), camera=(0, 0, 5)) | Camera
rm.Scene(rm.sphere(), lights=["sun"]) | Sun
rm.Scene("sphere") | a node such as sphere()
rm.Scene() | node
"""


def rows(table: str) -> list[tuple[str, str]]:
    split = (line.rpartition(" | ") for line in table.strip("\n").splitlines())
    return [(typed, told.strip()) for typed, _, told in split]


FORMER = """
rm.Sun(direction=(1, 1, 1)) | 'sun_direction'
rm.SunSky(direction=(1, 1, 1)) | 'sun_direction'
rm.Camera(direction=(1, 1, 1)) | 'view_from'
rm.Camera.framing(rm.box(), direction=(1, 1, 1)) | 'view_from'
rm.SpotLight((0, 3, 0), angle=1) | 'half_angle'
rm.PointLight((0, 3, 0), softness=1) | 'radius'
rm.SpotLight((0, 3, 0), softness=1) | 'radius'
rm.ImageSky(file="a.hdr") | 'source'
rm.ImageSky("a.hdr", turn=1) | 'rotation'
rm.mesh(file="a.stl") | 'source'
rm.planar(picture="a.png") | 'source'
rm.triplanar(picture="a.png") | 'source'
rm.grid(np.zeros((2, 2, 2)), centre=(0, 0, 0)) | 'center'
rm.sampled(np.zeros((2, 2, 2)), centre=(0, 0, 0)) | 'center'
rm.isosurface(np.zeros((2, 2, 2)), 0, centre=(0, 0, 0)) | 'center'
rm.prove(rm.sphere(), within=1) | 'tolerance'
rm.prove(rm.sphere(), pixels="centre") | "center" or "whole"
rm.rounded_box((1, 1, 1), radius=.1) | 'rounding'
rm.rounded_rectangle((1, 1), radius=.1) | 'rounding'
rm.round_cone(bottom=.1) | 'radius'
rm.trapezoid(bottom=.1) | 'width'
rm.moon(offset=.1) | 'distance'
rm.mandelbox(factor=2) | 'scale'
rm.polygon() | needs 'points'
rm.polyline() | needs 'points'
rm.triangle() | needs 'a'
rm.flat_triangle() | needs 'a'
rm.line() | needs 'a'
rm.capsule() | =
rm.box().bounds | =
"""
"""Names of parameters that were replaced, and shapes that have no natural default."""

TABLES = [FORMER, BLENDER, SHADERTOY, OPENSCAD, FOGLEMAN, THREE, NUMPY, SLIPS]


@pytest.mark.parametrize(("typed", "told"), [row for table in TABLES for row in rows(table)])
def test_what_newcomers_type_is_accepted_or_answered(typed: str, told: str) -> None:
    """`=`: accepted without a word. `!TEXT`: accepted with a warning that says TEXT. Else refused, with this text."""
    names: dict[str, Any] = {"rm": rm, "math": math, "np": np}
    code = compile(typed, f"{typed}.py", "eval")  # a line of its own, because a line warns once
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        if told == "=" or told.startswith("!"):
            eval(code, names)
        else:
            with pytest.raises(rm.RaymarchError) as refused:
                eval(code, names)
            assert told in str(refused.value)
    warned = [str(warning.message) for warning in caught]
    assert len(warned) == told.startswith("!")
    assert all(told[1:] in message for message in warned)


def test_three_hundred_expressions_are_typed() -> None:
    typed = [row[0] for table in TABLES for row in rows(table)]
    assert len(set(typed)) >= 300
