"""A scene as a module for three.js: a ShaderMaterial for a square that fills the screen."""

from __future__ import annotations

import json
from typing import Any

from raymarch.export.inputs import Text, declarations, inputs, planned, refuse_textures, shader_of
from raymarch.expr.glsl import TIME
from raymarch.scene.parameter import Values
from raymarch.scene.scene import Scene
from raymarch.shader.assemble import HEADERS

MODULE = """// A scene of raymarch as a material of three.js, for WebGL 2. It draws the picture in sRGB.
//
//   import { createMesh, resize } from "./NAME";
//   const mesh = createMesh();  // a square that fills the screen, whatever the camera
//   scene.add(mesh);
//   resize(mesh.material, renderer);  // now, and whenever its size changes
//   mesh.material.uniforms.u_time.value = seconds;  // if the scene moves
import { GLSL3, Mesh, PlaneGeometry, RawShaderMaterial, Vector2, Vector3, Vector4 } from "three";

// Name, type, initial value, range and meaning of each uniform; `param` is the name in Python.
export const inputs = INPUTS;

const vertexShader = `in vec3 position;
void main() {
    gl_Position = vec4(position.xy, 0.0, 1.0);
}
`;

const fragmentShader = `SHADER`;

const vectors = { 2: Vector2, 3: Vector3, 4: Vector4 };

// A ShaderMaterial. `values` replace initial values of uniforms, by their names.
export function createMaterial(values = {}) {
    const uniforms = {};
    for (const { name, value } of inputs) {
        const given = values[name] ?? value;
        uniforms[name] = { value: Array.isArray(given) ? new vectors[given.length](...given) : given };
    }
    const depth = { depthTest: false, depthWrite: false, toneMapped: false };
    return new RawShaderMaterial({ glslVersion: GLSL3, uniforms, vertexShader, fragmentShader, ...depth });
}

export function createMesh(values = {}) {
    const mesh = new Mesh(new PlaneGeometry(2, 2), createMaterial(values));
    mesh.frustumCulled = false;
    return mesh;
}

// Sets the size of the picture to that of a renderer, in pixels.
export function resize(material, renderer) {
    renderer.getDrawingBufferSize(material.uniforms.u_resolution.value);
}
"""


def text_of(scene: Scene, values: Values) -> Text:
    """The module. Its uniforms have the given values initially.

    Raises PlanError for textures, and for lights and a sky light that change.
    """
    made = planned(scene, "standalone")
    shader = shader_of(made)
    refuse_textures(made, shader, ".js")
    lines, listed = declarations(made, shader, values), []
    specs = {
        shader.parameters[name]: (name, spec) for name, spec in made.parameters.items() if name in shader.parameters
    }
    for name, kind, value, note in inputs(made, shader, values):
        lines[name] = f"uniform {kind} {name};"
        found: dict[str, Any] = {"name": name, "type": kind, "value": _numbers(value), "note": note}
        if name in specs and name != TIME:
            param, spec = specs[name]
            found |= {"param": param, "min": spec.min, "max": spec.max}
        listed.append(found)
    _, *head = HEADERS["300 es"]
    text = "\n".join([*head, shader.text(version="", declarations=lines)])
    table = ",\n    ".join(json.dumps(each, ensure_ascii=False) for each in listed)
    text = text.replace("\\", "\\\\").replace("`", "\\`").replace("${", "\\${")
    return Text(MODULE.replace("INPUTS", f"[\n    {table}\n]").replace("SHADER", text))


def _numbers(text: str) -> float | list[float]:
    """The numbers of a GLSL literal, such as vec2(1.0, 2.0)."""
    found = [float(number) for number in (text.partition("(")[2].rstrip(")") or text).split(",")]
    return found if "(" in text else found[0]
