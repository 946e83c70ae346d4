"""Shaders for game engines as GLSL of the desktop: what the engine gives is written out, to draw them here."""

from __future__ import annotations

import re

GODOT = """#version 330 core
layout(location = 0) out vec4 COLOR;
uniform vec2 host_size;
#define SCREEN_PIXEL_SIZE (1.0 / host_size)
#define UV (vec2(gl_FragCoord.x, host_size.y - gl_FragCoord.y) / host_size)
uniform float TIME;
"""

RESERVED = frozenset(
    """
    shader_type render_mode instance global group_uniforms lowp mediump highp flat smooth varying hint_range
    source_color TIME PI TAU E UV COLOR VERTEX TEXTURE FRAGCOORD SCREEN_UV POINT_COORD TEXTURE_PIXEL_SIZE NORMAL
    LIGHT SPECULAR vertex fragment light start continue_ true false
    """.split()
)
"""Names that shaders of Godot may not define."""


def godot_as_glsl(text: str) -> str:
    """A canvas_item shader of Godot as a fragment shader."""
    assert text.startswith("shader_type canvas_item;\n")
    text = re.sub(r" : hint_range\([^)]*\)", "", text.partition("\n")[2])
    return GODOT + text.replace("void fragment() {", "void main() {")


def godot_faults(text: str) -> list[str]:
    """What Godot's language does not have: variables outside of functions, layouts, and lines for a preprocessor."""
    lines = [line.partition("//")[0] for line in text.split("\n")]
    found = [f"no {word}" for word in ("layout", "#", "precision ", "gl_") if any(word in code for code in lines)]
    depth = 0
    for code in lines:
        if depth == 0 and (named := re.match(r"(\w+) \w+ ?(\[\d*\])? ?(=.*)?;", code)):
            found += [code] if named[1] not in ("uniform", "const", "shader_type") else []
        depth += code.count("{") - code.count("}")
    return found


STUB = """
export const GLSL3 = "300 es";
export class RawShaderMaterial { constructor(given) { Object.assign(this, given); } }
export class PlaneGeometry {}
export class Mesh { constructor(geometry, material) { this.material = material; } }
class Vector {
    constructor(...numbers) { this.numbers = numbers; }
    set(...numbers) { this.numbers = numbers; }
}
export const Vector2 = Vector, Vector3 = Vector, Vector4 = Vector;
export class WebGLRenderer {
    constructor({ canvas }) { this.canvas = canvas; }
    getDrawingBufferSize(size) { size.set(this.canvas.width, this.canvas.height); }
    setSize(width, height) { Object.assign(this.canvas, { width, height }); }
    getContext() { return this.gl ??= this.canvas.getContext("webgl2", { preserveDrawingBuffer: true }); }
    render({ mesh }) {
        const gl = this.getContext(), { material } = mesh, program = gl.createProgram();
        for (const stage of ["vertex", "fragment"]) {
            const kind = gl[`${stage.toUpperCase()}_SHADER`], text = material[`${stage}Shader`];
            const shader = gl.createShader(kind);
            gl.shaderSource(shader, `#version ${material.glslVersion}\\n${text}`);
            gl.compileShader(shader);
            if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(shader));
            gl.attachShader(program, shader);
        }
        gl.linkProgram(program);
        if (!gl.getProgramParameter(program, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(program));
        gl.useProgram(program);
        for (const [name, { value }] of Object.entries(material.uniforms)) {
            const numbers = value.numbers ?? [value];
            gl[`uniform${numbers.length}fv`](gl.getUniformLocation(program, name), numbers);
        }
        gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
        gl.bufferData(gl.ARRAY_BUFFER, new Float32Array([-1, -1, 0, 3, -1, 0, -1, 3, 0]), gl.STATIC_DRAW);
        const place = gl.getAttribLocation(program, "position");
        gl.enableVertexAttribArray(place);
        gl.vertexAttribPointer(place, 3, gl.FLOAT, false, 0, 0);
        gl.viewport(0, 0, this.canvas.width, this.canvas.height);
        gl.drawArrays(gl.TRIANGLES, 0, 3);
    }
}
export class Scene { add(mesh) { this.mesh = mesh; } }
export class Camera {}
"""
"""What a module takes of three.js, by WebGL 2 alone. RAYMARCH_THREE=three.module.js tests with three.js itself."""

PAGE = """<!doctype html><title>page</title><canvas></canvas><script>
async function draw(three, module, values, width, height) {
    const url = text => URL.createObjectURL(new Blob([text], { type: "text/javascript" }));
    const map = document.createElement("script");
    map.type = "importmap";
    map.textContent = JSON.stringify({ imports: { three: url(three) } });
    document.head.append(map);
    const THREE = await import("three"), made = await import(url(module));
    const canvas = document.querySelector("canvas");
    const renderer = new THREE.WebGLRenderer({ canvas, preserveDrawingBuffer: true });
    renderer.setSize(width, height);
    const scene = new THREE.Scene(), mesh = made.createMesh(values);
    scene.add(mesh);
    made.resize(mesh.material, renderer);
    renderer.render(scene, new THREE.Camera());
    const gl = renderer.getContext(), pixels = new Uint8Array(4 * width * height);
    gl.readPixels(0, 0, width, height, gl.RGBA, gl.UNSIGNED_BYTE, pixels);
    return { pixels: [...pixels], names: made.inputs.map(each => each.name) };
}
</script>"""
"""A page whose function `draw` draws a module by a text of three.js."""
