"""Names of other tools, and what is written for them here. Messages about unknown names read these tables.

A key is in lower case and without underscores, so that `lookAt`, `look_at` and `LookAt` are one. A value is what to
write, as a user would write it.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from difflib import get_close_matches

from raymarch.errors import SceneError, UnknownNameError


def _keys(table: Mapping[str, str]) -> dict[str, str]:
    """One entry for each of the names of a row."""
    found = [(key, text) for names, text in table.items() for key in names.split()]
    assert len(found) == len(dict(found)), [key for key, text in found if dict(found)[key] != text]
    return dict(found)


FUNCTIONS = _keys(
    {
        "smoothunion smin smoothmin opsmoothunion sunion softunion blend": "rm.union(a, b, k=0.2)",
        "smoothintersection smax smoothmax opsmoothintersection": "rm.intersection(a, b, k=0.2)",
        "smoothdifference smoothsubtraction smoothsubtract opsmoothsubtraction": "rm.difference(a, b, k=0.2)",
        "add join merge group combine together opunion": "a | b, or rm.union(*nodes)",
        "subtract subtraction cut minus opsubtraction": "a - b, or rm.difference(a, b)",
        "intersect common opintersection": "a & b, or rm.intersection(a, b)",
        "cube cuboid block sdbox boxgeometry": "rm.box((1, 1, 1))",
        "ball sdsphere uvsphere icosphere spheregeometry": "rm.sphere(1)",
        "donut sdtorus torusgeometry": "rm.torus(major=1, minor=0.25)",
        "ground halfspace groundplane sdplane planegeometry": "rm.plane(offset=0)",
        "cappedcylinder rod sdcylinder cylindergeometry": "rm.cylinder(radius=1, height=2)",
        "cappedcone frustum sdcone": "rm.cone(radius=0.9, height=1.6, top=0.4)",
        "roundbox sdroundbox roundedboxgeometry": "rm.rounded_box(...)",
        "boxframe wireframebox sdboxframe": "rm.box_frame(...)",
        "segment": "rm.capsule(a, b, radius)",
        "rect square square2d": "rm.rectangle(...)",
        "ngon": "rm.regular_polygon(...)",
        "annulus": "rm.ring(...)",
        "rotatex rotatey rotatez": 'node.rotate(angle, "x"), with the angle in radians',
        "movex movey movez move": "node.translate((x, y, z))",
        "lathe rotateextrude lathegeometry": "flat.revolve(offset)",
        "onion hollow oponion": "node.shell(thickness)",
        "light lights": "rm.Sun, rm.PointLight, rm.SpotLight or rm.SphereLight",
        "directionallight sunlight distantlight": "rm.Sun(direction)",
        "pointlamp omnilight": "rm.PointLight(position)",
        "arealight rectarealight quadlight": "rm.RectLight(...) or rm.SphereLight(position, radius)",
        "ambientlight hemispherelight environmentlight ambient": "rm.Sky(color, light=True)",
        "background backdrop": "rm.Sky(color)",
        "environment hdri envmap environmentmap": 'rm.ImageSky("file.hdr")',
        "occlusion ao ambientocclusion": "rm.AmbientOcclusion()",
        "tone tonemap tonemapper": 'rm.ToneMapping("aces")',
        "glow glare unrealbloompass": "rm.Bloom(strength, radius), in Scene(post=[...])",
        "oprep oprepetition pmod": "node.repeat(spacing, count)",
        "optwist": "node.twist(rate)",
        "opround": "node.round(radius)",
        "settings options renderoptions rendersettings": "rm.Quality(...)",
        "slider parameter uniform": "rm.Param(name, value, min, max)",
        "physicalmaterial pbr pbrmaterial principled principledbsdf phong lambert meshstandardmaterial "
        "meshbasicmaterial meshphysicalmaterial meshphongmaterial meshlambertmaterial": "rm.Material(...)",
        "image2d loadimage": "rm.planar(picture) for a texture, rm.image(file) for a flat shape",
        "texture texture2d sampler": "rm.planar(picture) or rm.triplanar(picture)",
        "iresolution resolution": "size=(width, height), of rm.render and rm.Renderer",
        "imouse mouse": "rm.Param(name, value, min, max), a slider",
        "perspectivecamera orthographiccamera lookat": "rm.Camera(position, target)",
        "webglrenderer": "rm.Renderer(size)",
        "inversesqrt rsqrt": "1 / rm.sqrt(x)",
        "reflect": "v - 2 * rm.dot(v, n) * n",
        "mat2 mat3 mat4 matrix": "node.transform(matrix), with an array of shape (3, 3) or (4, 4)",
        "import importstl importmesh loadmesh": "rm.mesh(file)",
        "surface": "rm.heightmap(heights)",
        "lerp": "rm.mix(a, b, t)",
        "saturate": "rm.clamp(x, 0, 1)",
        "frac": "rm.fract(x)",
        "arcsin arccos arctan": "rm.asin, rm.acos, rm.atan",
        "arctan2": "rm.atan2(y, x)",
        "norm magnitude": "rm.length(v)",
        "vector vec vector3 float3 point": "rm.vec3(x, y, z), or a tuple (x, y, z)",
        "vector2 float2": "rm.vec2(x, y), or a tuple (x, y)",
        "vector4 float4": "rm.vec4(x, y, z, w)",
        "round": "rm.floor(x + 0.5)",
        "random rand randomof": "rm.hash(cell)",
        "held detach": "raymarch.expr.vocabulary.stop_gradient",
        "perlin simplex perlinnoise simplexnoise snoise": "rm.gradient_noise(p), or rm.fbm(p)",
        "voronoi cellular cellnoise": 'rm.worley(p), or rm.worley(p, "F2-F1")',
        "ridgednoise ridgedmultifractal": "rm.ridged(p)",
        "clouds": "rm.noise(first, second, size)",
        "checkerboard chessboard": 'rm.checker(first, second, size, axis="y")',
        "gridtexture lines": 'rm.grid_lines(first, second, size, width, axis="y")',
        "display view": "rm.show(scene), or the command `raymarch view SCENE.py`",
        "rgb color colour hex srgb": 'a tuple (r, g, b) of linear RGB, or "#ff8800", "orange", rm.vec3("orange") * 2',
        "hsv hsl hsvtorgb hsv2rgb": "colorsys.hsv_to_rgb(h, s, v), of Python",
        "save write": 'rm.render(scene).save("picture.png"), or rm.export(scene, "a.stl")',
        "trace raymarch raytrace": "rm.render(scene)",
        "elapsed t seconds": "rm.time",
        "x y z p position": "a function of the point, such as lambda p: rm.sin(p.x), for .displace_by or a Material",
        "cmap palette cosinepalette gradient viridis": 'rm.colormap(t, "viridis"), or rm.mix("navy", "orange", t)',
        "generate marchingcubes dualcontouring tomesh trianglemesh polygonize": "rm.triangulate(node)",
        "mengersponge kaleidoscope fractal kifs ifs": "rm.mandelbulb(), rm.menger(), or rm.fold_fractal(...)",
        "bars bar barchart histogram": "rm.union(*[rm.box((w, h, d)).translate((x, h / 2, z)) for ...])",
        "scatter scatterplot scatterpoints points pointcloud dots": "rm.instances(rm.sphere(0.1), positions, colors)",
        "clone copy copies instanced duplicate": "rm.instances(node, positions)",
        "heightfield terrain landscape surfaceplot": "rm.heightmap(heights)",
        "spline curve path": "rm.polyline_tube(points, radius), or rm.bezier_tube(a, b, c, radius)",
        "stairs staircase": "rm.union(*[rm.box(...).translate(...) for ...])",
        "column pillar": "rm.cylinder(radius=1, height=2)",
        "prism hexagon": "rm.regular_polygon(6).extrude(1)",
        "chain": "rm.link(...), repeated",
        "letters font label text3d": 'rm.text("abc").extrude(0.2)',
        "gold metal chrome steel": "rm.Material(albedo=..., metalness=1, roughness=0.2)",
        "glass water crystal": "rm.Material(transmission=1, ior=1.5)",
        "emissive": "rm.Material(emission=...)",
        "volume volumetric smoke fire cloud": "rm.Medium(density, bounds), as Scene(fog=...)",
        "rotation rot rot2d": "node.rotate(angle, axis)",
        "degrees rad2deg deg": "math.degrees(angle)",
        "radians deg2rad rad": "math.radians(angle)",
        "clip": "rm.clamp(x, low, high) for a number, a & b for solids",
        "workplane drawing profile path2d pline buildsketch makeface": "rm.sketch(start).line_to((x, y)) ... .close()",
        "loft blendprofiles": "flat.extrude_to(other, height)",
        "intersectray castray pick": "rm.raycast(node, origins, directions)",
        "convexhull": "rm.hull(points)",
        "minkowski minkowskisum": "node.offset(radius), the sum with a ball, or node.elongate(extent), with a box",
        "linspace arange array range": "numpy's function of that name",
        "savepng savefig imsave": 'rm.render(scene).save("picture.png")',
        "imshow": "rm.show(scene)",
    }
)
"""Names looked for in the package."""

METHODS = _keys(
    {
        "castray intersectray": "raycast(origins, directions)",
        "materialof colorat": "material_at(points)",
        "loft": "extrude_to(other, height), of a flat shape",
        "hull convexhull": "rm.hull(points), a function",
        "minkowski minkowskisum": "offset(radius), the sum with a ball, or .elongate(extent), with a box",
        "implicit": "rm.implicit(function, bounds), a function",
        "move moved shift at place": "translate((x, y, z))",
        "rotatex": 'rotate(angle, "x")',
        "rotatey": 'rotate(angle, "y")',
        "rotatez": 'rotate(angle, "z")',
        "turn spin rotated": 'rotate(angle, "y")',
        "color colour setcolor paint painted withcolor diffuse albedo": "material(rm.Material(color=...))",
        "hide hidden invisible visibility raytype castshadow": "visible(camera=False)",
        "setmaterial withmaterial shade texture": "material(rm.Material(...))",
        "smoothunion smin softunion opsmoothunion blend": "union(other, k=0.2)",
        "smoothintersection opsmoothintersection": "intersection(other, k=0.2)",
        "smoothdifference smoothsubtract smoothsubtraction": "difference(other, k=0.2)",
        "add join merge combine": "union(other), or a | b",
        "subtract cut minus sub": "difference(other), or a - b",
        "intersect common clip": "intersection(other), or a & b",
        "array tile repeatinfinite repeatlimited": "repeat(spacing, count)",
        "repeatpolar polarrepeat modpolar radial circulararray": "polar(count)",
        "onion hollow thicken": "shell(thickness)",
        "resize size stretch scaled": "scale(factor)",
        "mirrorx mirrory mirrorz symmetry": 'mirror("x")',
        "flip reflect reflection": 'transform(np.diag([-1, 1, 1, 1])), or with the half itself .mirror("x")',
        "grow inflate dilate erode shrink": "offset(distance)",
        "rounded fillet smooth bevel chamfer": "round(radius)",
        "lathe revolution": "revolve(offset)",
        "clone copy duplicate": "translate((x, y, z)): nodes do not change, so one may stand in several places",
        "k": "union(other, k=0.2)",
        "invert inverse negate": "complement()",
        "bbox boundingbox aabb extent": "bounds",
        "sdf evaluate eval value": "distance(points)",
        "normal normals": "gradient(points)",
        "shader code": "glsl()",
        "render": "rm.render(node)",
        "save write export": 'rm.export(node, "a.stl") for a file, rm.render(node).save("a.png") for a picture',
        "show view display": "rm.Scene(node).show()",
        "volume area surfacearea mass centroid centerofmass massproperties measure": "rm.triangulate(node).volume",
        "generate marchingcubes tomesh vertices faces triangles": "rm.triangulate(node)",
    }
)
"""Names looked for in a node."""

SKETCHES = _keys(
    {
        "lineto hlineto vlineto": "line_to((x, y))",
        "line hline vline polarline": "line_by((x, y))",
        "polyline": "line_to((x, y)) for each point, or rm.polygon(points)",
        "threepointarc sagittaarc": "arc_through(middle, end)",
        "radiusarc arc": "arc_to(end, radius)",
        "tangentarcpoint tangentarc": "tangent_arc_to(end)",
        "spline curve": "spline_to(points)",
        "bezier curveto": "bezier_to(b, c, d)",
        "move moveto circle rect": "hole(rm.sketch(...)), or sketch.close() - rm.circle(radius)",
        "offset2d": "close().offset(distance)",
        "wire face makeface end done build finish": "close()",
    }
)
"""Names looked for in a sketch."""

PARAMETERS = _keys(
    {
        "metallic metal metalnessfactor": "metalness",
        "diffuse basecolor colour rgb tint": "color",
        "reflectance specularcolor": "f0",
        "rough roughnessfactor gloss glossiness smoothness": "roughness",
        "emissive glow emit": "emission",
        "transparency transparent opacity alpha glass": "transmission",
        "eta index refraction refractiveindex indexofrefraction": "ior",
        "bump bumpmap displacement": "height",
        "normalmap": "normal",
        "ao aomap": "occlusion",
        "lookat at look": "target",
        "centre": "center target",
        "center": "target",
        "pos eye origin location lookfrom from": "position",
        "fieldofview fovy": "fov",
        "angle spotsize cutoffangle": "half_angle softness fov angle",
        "ortho orthographic": "projection",
        "znear nearclip": "near",
        "zfar farclip": "far",
        "lensradius apertureradius fstop fnumber": "aperture",
        "focusdistance focaldistance focallength": "focus",
        "orthoscale orthographicsize parallelscale ymag": "height",
        "shuttertime exposuretime motionblur": "shutter",
        "background backgroundcolor environment env": "sky",
        "light lamps": "lights",
        "object objects shape shapes geometry root sdf solid": "node",
        "tonemap tonemapping": "tone",
        "maxbounces depth maxdepth": "bounces depth height",
        "spp samplesperpixel aa antialiasing": "samples",
        "steps maxiterations iterations": "max_steps",
        "power energy brightness strength": "intensity",
        "shadows castshadow castshadows": "shadow",
        "direction dir towards sunposition": "sun_direction view_from direction",
        "cutoff": "range half_angle",
        "softness": "radius",
        "size": "extent scale height radius width",
        "radius": "rounding width major minor outer",
        "bottom base": "radius width",
        "r d rad diameter": "radius size",
        "fontsize": "height",
        "dimensions dims extents": "size extent",
        "width": "size extent",
        "h length": "height",
        "height": "offset level size",
        "y level distance translation offsets": "offset",
        "offset": "distance",
        "resolution": "cells",
        "smooth smoothing blendradius": "k",
        "bevel fillet rounding": "radius",
        "factor": "scale",
        "file filename picture path image texture uri url": "source",
        "within error": "tolerance",
        "n num copies": "count",
        "colors colours values": "materials",
        "period cell step": "spacing",
        "turn rotate": "rotation angle",
        "rotation": "angle",
        "degrees theta radians": "angle half_angle rotation",
        "frequency freq": "rate scale size",
        "seed": "phase",
        "thickness": "width minor",
        "r1 radius1 outerradius majorradius": "major outer radius",
        "r2 radius2 innerradius tubeheight minorradius tube": "minor inner",
    }
)
"""Names of parameters. The first name of a row that a function has is the one that is meant."""

WITHOUT = _keys(
    {
        "samples spp quality": "quality=rm.Quality(samples=...)",
        "ambient ambientlight": "sky=rm.Sky(color, light=True)",
        "resolution size width height": "size=(width, height), of rm.render and rm.Renderer",
        "material materials": "node.material(rm.Material(...))",
        "exposure": "tone=rm.ToneMapping(exposure=...)",
        "shadow shadows": "lights=[rm.Sun(shadow=True)]",
        "tracer maxsteps integrator preset": "quality=rm.Quality(...)",
        "color diffuse": "node.material(rm.Material(color=...))",
        "position center centre origin pos": ".translate((x, y, z)) of the node",
        "rotation": ".rotate(angle, axis) of the node",
        "smooth smoothness k": "rm.union(a, b, k=0.2)",
        "reflectivity mirror": "metalness=1, roughness=0",
        "angle": "a number in radians",
        "lipschitz": "node.displace_by(function, lipschitz=...)",
        "bounces maxdepth depth": "rm.Scene(bounces=...)",
    }
)
"""Names of parameters that a function does not have, and what to use in their place."""

CHOICES = _keys(
    {
        "fillet rounded": "round",
        "smooth smin poly polynomial": "quadratic",
        "bevel": "chamfer",
        "exp": "exponential",
        "power": "root",
        "raytracing raytrace recursive": "whitted",
        "pathtracing pathtrace pathtracer": "path",
        "filmic hable uncharted2": "aces",
        "ortho parallel isometric": "orthographic",
        "accumulation progressive": "accumulate",
        "taa reprojection": "reproject",
    }
)
"""Values of other tools for an argument that is one of some words."""

NEEDED = {
    "noise": "two numbers or colours, between which it is a pattern; rm.value_noise(p) and rm.fbm(p) are numbers",
}
"""Functions that other tools have by the same name with fewer arguments, and what these take or are called here."""

WITH_SCENES = _keys(
    {
        "render draw image picture": "rm.render(scene)",
        "save write": "rm.render(scene).save(file)",
        "export tohtml": "rm.export(scene, file)",
        "view window": "the command raymarch view",
    }
)
"""Names of what other tools do with a scene, and what to use in their place."""

OPERATORS = {
    "+": "a | b for the union, node.translate((x, y, z)) to move",
    "*": "node.scale(factor), or a & b for the intersection",
    "/": "node.scale(1 / factor)",
    "@": "node.transform(matrix)",
    "**": "a & b for the intersection",
    "%": "node.repeat(spacing)",
    "-": "a - b for the difference of two nodes; node.complement() for the outside",
}
"""Operators of Python that nodes do not have."""


NEAR = 0.81
"""How similar names are (`difflib`) of which one is suggested for the other: a letter in six differs. A suggestion that
is not meant is worse than none."""


def key(name: str) -> str:
    """A name as the tables have it."""
    return name.lower().replace("_", "")


def _nearest(name: str, names: Collection[str]) -> str | None:
    """The known name that is equal but for case and underscores, or else close."""
    found = key(name)
    same = [known for known in names if key(known) == found]
    # A part of a name, such as "cyl", or a name with a suffix of its own, such as "text3d" and "export_mesh".
    parts = [known for known in names if len(found) > 2 and key(known).startswith(found)]
    parts += [known for known in names if len(known) > 3 and name.startswith(known) and not name[len(known)].isalpha()]
    if same or parts:
        return (same or sorted(parts, key=len))[0]
    close = get_close_matches(name.lower(), list(names), 1, NEAR)
    return next(iter(close), None) or next((known for known in names if _slip(name.lower(), known.lower())), None)


def _slip(typed: str, name: str) -> bool:
    """True for a slip of the fingers: two neighbouring letters are exchanged, or one is the next key of its row."""
    differ = [i for i, (a, b) in enumerate(zip(typed, name, strict=False)) if a != b]
    if len(typed) != len(name) or not differ or differ[-1] - differ[0] > 1:
        return False
    first, last = differ[0], differ[-1]
    if first != last:
        return typed[first] == name[last] and typed[last] == name[first]
    a, b = (row.find(c) for c in (typed[first], name[first]) for row in [_row_of(typed[first])])
    return a >= 0 and b >= 0 and a - b in (-1, 1)


def _row_of(letter: str) -> str:
    """The row of keys that a letter is on."""
    return next((row for row in ("qwertyuiop", "asdfghjkl", "zxcvbnm") if letter in row), "")


def meant(name: str, known: Sequence[str]) -> str:
    """ "did you mean 'lights'? " for a parameter that other tools have, or that is close to a known one, or nothing.

    known : the parameters that are legal.
    """
    other = next((other for other in PARAMETERS.get(key(name), "").split() if other in known), None)
    if other is not None:
        return f"did you mean '{other}'? "
    close = _nearest(name, known)
    if close is not None:
        return f"did you mean '{close}'? "
    return f"use {WITHOUT[key(name)]}; " if key(name) in WITHOUT else ""


def meant_among(given: object, among: Sequence[str]) -> str:
    """ "did you mean 'round'? " for a word that other tools have, or that is close to a legal one, or nothing."""
    if not isinstance(given, str):
        return ""
    other = CHOICES.get(key(given))
    close = other if other in among else _nearest(given, among) if given.strip() else None
    return "" if close is None else f"did you mean '{close}'? "


def unknown_function(name: str, names: Collection[str], methods: Collection[str]) -> UnknownNameError:
    """The error for a name that the package does not have. methods : the names of the methods of nodes."""
    text, names = FUNCTIONS.get(key(name)), [known for known in names if not known.startswith("_")]
    if text is None and name in methods:
        text = f"node.{name}(...)"
    if text is None and (close := _nearest(name, names)) is not None:
        text = f"rm.{close}"
    if text is None:
        if (method := METHODS.get(key(name))) is not None:
            text = f"node.{method}"
        elif (close := _nearest(name, methods)) is not None:
            text = f"node.{close}(...)"
    legal = f"did you mean {text}?" if text else "help(raymarch) and docs/names.md list the names"
    return UnknownNameError(f"raymarch has no '{name}'", legal=legal)


def unknown_attribute(owner: str, name: str, names: Collection[str], methods: bool = False) -> UnknownNameError:
    """The error for an attribute that a node, sketch or part of a scene does not have. methods : True for a node."""
    if methods:
        text = METHODS.get(key(name))
    elif owner == "a sketch":
        text = SKETCHES.get(key(name))
    else:
        text = next((other for other in PARAMETERS.get(key(name), "").split() if other in names), None)
    text = text or _nearest(name, names)
    if text is not None:
        legal = f"did you mean {'' if text.startswith('rm.') else '.'}{text}?"
    elif owner == "a Scene" and key(name) in WITH_SCENES:
        legal = f"use {WITH_SCENES[key(name)]}"
    else:
        legal = f"legal: {', '.join(names)}"
    return UnknownNameError(f"{owner} has no '{name}'", legal=legal)


ALONE = {
    "-": "node.complement() for the outside, a - b for the difference",
    "+": "the node itself",
    "~": "node.complement()",
    "abs": "node.shell(thickness) for a hollow solid",
    "<": "a | b in place of min(a, b), a & b in place of max(a, b)",
    ">": "a & b in place of max(a, b), a | b in place of min(a, b)",
}
"""Signs, functions and comparisons of Python that nodes do not have."""

OF_SOLIDS = {
    "min": "a | b for the union, rm.union(a, b, k=0.2) for a smooth one",
    "max": "a & b for the intersection, a - b for the difference",
    "abs": ALONE["abs"],
    "mix": "rm.morph(a, b, t)",
    "length": "node.bounds",
}
"""Functions of numbers that are called with solids, and what to use in their place."""


def refused_operator(symbol: str, left: str, right: str | None = None) -> SceneError:
    """The error for an operator that nodes do not have. right : None for a sign."""
    if right is None:
        return SceneError(f"{symbol}({left})" if symbol == "abs" else f"{symbol}{left}", legal=f"use {ALONE[symbol]}")
    return SceneError(f"{left} {symbol} {right}", legal=f"use {(ALONE if symbol in '<>' else OPERATORS)[symbol]}")
