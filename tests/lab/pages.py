"""Exported pages in a headless Chromium: their pictures against the renderer's, sizes, and screenshots.

    python -m tests.lab.pages [NAME ...] [--out FOLDER] [--exact]
    python -m tests.lab.pages --check [NAME ...]

A pixel is off if it differs by more than 2 of 255. Pixels on edges may be: a ray of float32 falls on either side. The
last column counts the pixels, not on edges, of the renderer's own picture that are off if its camera moves by 1 ulp.
Each page is drawn at 1280x720 and 390x844 and saved as a screenshot.

The first line is the largest error of the browser's sin(x) for |x| <= 8, by a shader of one line: 1.9e-4 in
SwiftShader, which OpenGL ES allows, and 7e-8 in Mesa. --exact replaces sin and cos in the pages by functions that are
right to 1e-7: the pixels that are not off any more were due to the device.

--check judges the browser's OpenGL as `raymarch doctor --check` judges a driver: pages of its scenes and of the hard
cases are drawn, and their distances, normals and colours are held against float64.
"""

from __future__ import annotations

import argparse
import base64
import json
import re
import sys
import tempfile
import time as clock_time
import warnings
import zlib
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import raymarch as rm
from raymarch.cost.device import SIZE as CHECKED
from raymarch.cost.device import Case, Row, cases, compared
from raymarch.errors import RaymarchError
from raymarch.scene import load
from raymarch.scene.parameter import set_values
from tests.hard.pictures import pairs
from tests.support.chromium import Browser, find

EXAMPLES = Path(rm.__file__).parents[1] / "examples"
SIZE = (320, 180)


def on_edges(picture: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Pixels that differ by more than 12 of 255 from one of their 8 neighbours."""
    height, width, _ = picture.shape
    around = np.pad(picture, ((1, 1), (1, 1), (0, 0)), mode="edge")
    shifted = [around[y : y + height, x : x + width] for y in range(3) for x in range(3)]
    return np.max([np.abs(s - picture).max(axis=2) for s in shifted], axis=0) > 12


SINE_ERROR = """(() => {
  const gl = document.createElement("canvas").getContext("webgl2");
  gl.getExtension("EXT_color_buffer_float");
  const program = gl.createProgram(), size = 64;
  const add = (kind, text) => {
    const made = gl.createShader(kind);
    gl.shaderSource(made, "#version 300 es\\nprecision highp float;\\n" + text);
    gl.compileShader(made);
    gl.attachShader(program, made);
  };
  add(gl.VERTEX_SHADER, `void main() {
      gl_Position = vec4(gl_VertexID == 1 ? 3.0 : -1.0, gl_VertexID == 2 ? 3.0 : -1.0, 0.0, 1.0);
    }`);
  add(gl.FRAGMENT_SHADER, `out vec4 color;
    void main() {
      float x = (dot(floor(gl_FragCoord.xy), vec2(1.0, 64.0)) - 2048.0) / 256.0;
      color = vec4(x, sin(x), 0.0, 1.0);
    }`);
  gl.linkProgram(program);
  const texture = gl.createTexture();
  gl.bindTexture(gl.TEXTURE_2D, texture);
  gl.texStorage2D(gl.TEXTURE_2D, 1, gl.RGBA32F, size, size);
  gl.bindFramebuffer(gl.FRAMEBUFFER, gl.createFramebuffer());
  gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, texture, 0);
  gl.viewport(0, 0, size, size);
  gl.useProgram(program);
  gl.drawArrays(gl.TRIANGLES, 0, 3);
  const found = new Float32Array(4 * size * size);
  gl.readPixels(0, 0, size, size, gl.RGBA, gl.FLOAT, found);
  let worst = 0;
  for (let i = 0; i < found.length; i += 4) worst = Math.max(worst, Math.abs(found[i + 1] - Math.sin(found[i])));
  return worst;
})()"""

EXACT = """
float reduced(float x, out int quarter) {
    float k = floor(x * 0.63661977 + 0.5);
    quarter = int(k);
    return ((x - k * 1.5703125) - k * 4.83751297e-4) - k * 7.5497899e-8;
}
float near_sine(float y) {
    float z = y * y;
    return y + y * z * (-0.16666655 + z * (8.3321609e-3 - z * 1.9515296e-4));
}
float near_cosine(float y) {
    float z = y * y;
    return 1.0 - 0.5 * z + z * z * (4.1666646e-2 + z * (-1.3887316e-3 + z * 2.4433157e-5));
}
float exact_sin(float x) {
    int quarter;
    float y = reduced(x, quarter), r = (quarter & 1) == 1 ? near_cosine(y) : near_sine(y);
    return (quarter & 2) == 2 ? -r : r;
}
float exact_cos(float x) {
    return exact_sin(x + 1.5707964);
}
vec2 exact_sin(vec2 v) { return vec2(exact_sin(v.x), exact_sin(v.y)); }
vec2 exact_cos(vec2 v) { return vec2(exact_cos(v.x), exact_cos(v.y)); }
vec3 exact_sin(vec3 v) { return vec3(exact_sin(v.xy), exact_sin(v.z)); }
vec3 exact_cos(vec3 v) { return vec3(exact_cos(v.xy), exact_cos(v.z)); }
"""


def make_exact(page: Path) -> None:
    """Replace sin and cos in the shader of a page."""
    html = page.read_text()
    found = re.search(r'(?<=<script id="data" type="application/json">).*?(?=</script>)', html, re.DOTALL)
    assert found is not None
    data = json.loads(found[0])
    text = data["shader"]
    if isinstance(text, dict):
        text = zlib.decompress(base64.b64decode(text["bytes"])).decode()
    head, ray, body = text.partition("struct Ray")
    data["shader"] = head + EXACT + ray + re.sub(r"\b(sin|cos)\(", r"exact_\1(", body)
    page.write_text(html[: found.start()] + json.dumps(data).replace("<", "\\u003c") + html[found.end() :])


SHOWN = "\nwindow.raymarch = { "
MEASURED = """measured: (width, height) => {
  const to = target(width, height, 3);
  const read = (k) => {
    const all = new Float32Array(4 * width * height);
    gl.bindFramebuffer(gl.FRAMEBUFFER, to.frame);
    gl.readBuffer(gl.COLOR_ATTACHMENT0 + k);
    gl.readPixels(0, 0, width, height, gl.RGBA, gl.FLOAT, all);
    return btoa(Array.from(new Uint8Array(all.buffer), (b) => String.fromCharCode(b)).join(""));
  };
  measure(to);
  const found = [read(0), read(1)];
  gl.bindFramebuffer(gl.FRAMEBUFFER, to.frame);
  gl.drawBuffers([gl.COLOR_ATTACHMENT0, gl.NONE, gl.NONE]);
  sample(0, to, unread.textures[0]);
  return [...found, read(0)];
}, """
"""What a page has in addition: the texels of its distances, normals and linear colours."""


def hard_cases() -> list[Case]:
    """The scenes of `raymarch doctor --check`, and those of the hard cases that have a picture."""
    return [*cases(), *(Case("hard", pair.name, partial(getattr, pair, "scene")) for pair in pairs())]


def judged(browser: Browser, case: Case, page: Path) -> Row:
    """A case drawn by its page, beside float64."""
    begin = clock_time.perf_counter()
    width, height = CHECKED
    try:
        scene = case.make()
        rm.export(scene, page)
        html = page.read_text()
        assert html.count(SHOWN) == 1
        page.write_text(html.replace(SHOWN, SHOWN + MEASURED))
        browser.open(page)
        browser.run("raymarch.play(false), raymarch.state.time = 0, raymarch.change()")
        read = browser.run(f"raymarch.measured({width}, {height})")
    except (RaymarchError, RuntimeError) as fault:
        return Row(case.group, case.name, fault=" ".join(str(fault).split())[:300])
    texels = (np.frombuffer(base64.b64decode(each), np.float32).reshape(height, width, 4)[::-1] for each in read)
    march, surface, color = (each.astype(np.float64) for each in texels)
    depth = np.where(march[..., 0] < 0.0, np.inf, march[..., 0])
    seconds = clock_time.perf_counter() - begin
    return compared(case, scene, depth, surface[..., :3], color[..., :3] if case.lit else None, seconds)


def check(names: list[str]) -> int:
    """Prints each case, and the count of those that are as in float64. 1 if any is not."""
    chosen = [case for case in hard_cases() if not names or case.name in names]
    bad = 0
    with tempfile.TemporaryDirectory() as folder, Browser() as browser:
        for case in chosen:
            row = judged(browser, case, Path(folder) / "page.html")
            bad += not row.holds
            counts = f"{row.hits:5} hits, {row.missed} missed, {row.false} invented"
            worst = f"depth {row.depth:.2g} px, normal {row.normal:.2g} degrees, color {row.color:.2g}"
            verdict = "" if row.holds else "DIFFERS"
            print(
                f"{row.group:10} {row.name:30} {verdict:8} {counts}, {worst}, {row.seconds:.1f} s {row.fault}",
                flush=True,
            )
    print(f"{len(chosen) - bad} of {len(chosen)} scenes are as in float64")
    return int(bad > 0)


def unstable(renderer: rm.Renderer, scene: rm.Scene, wanted: NDArray[np.int64]) -> int:
    """Pixels, not on edges, that are off in the renderer's own picture if its camera moves by 1 ulp."""
    given = scene.pose(set_values(scene.parameters))
    worst = 0
    for way in (np.inf, -np.inf):
        place = np.nextafter(given.position.astype(np.float32), np.float32(way)).astype(float)
        renderer.forget()
        shifted = scene.replace(camera=scene.camera.replace(position=tuple(place)))
        found = np.asarray(renderer.render(shifted).image()).astype(int)
        worst = max(worst, int(((np.abs(found - wanted).max(axis=2) > 2) & ~on_edges(wanted)).sum()))
    return worst


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*")
    parser.add_argument("--out", type=Path, default=Path("pages"))
    parser.add_argument("--exact", action="store_true", help="replace sin and cos in the pages")
    parser.add_argument("--check", action="store_true", help="hold pages of the hard cases against float64")
    given = parser.parse_args()
    if find() is None:
        print("no Chromium is installed: install the package chromium")
        return 2
    if given.check:
        warnings.simplefilter("ignore")
        return check(given.names)
    given.out.mkdir(parents=True, exist_ok=True)
    scenes = sorted([*EXAMPLES.glob("*.py"), *EXAMPLES.glob("papers/*.py")])
    worst = 0
    with Browser() as browser, rm.Renderer(SIZE) as renderer:
        print(f"largest error of the browser's sin: {browser.run(SINE_ERROR):.1e}")
        print("page                     kB  compile s   off   off, not on edges   of pixels   at 1 ulp")
        for file in scenes:
            name = f"{file.parent.name}-{file.stem}" if file.parent != EXAMPLES else file.stem
            if given.names and name not in given.names:
                continue
            target = given.out / f"{name}.html"
            try:
                scene = load(file)
                rm.export(scene, target)
            except RaymarchError as fault:
                print(f"{name:20} refused: {fault}")
                continue
            if given.exact:
                make_exact(target)
            start = clock_time.perf_counter()
            browser.open(target)
            spent = clock_time.perf_counter() - start
            browser.run("raymarch.play(false), raymarch.state.time = 0, raymarch.change()")
            found = browser.picture(*SIZE, samples=scene.quality.samples).astype(int)
            renderer.forget()
            wanted = np.asarray(renderer.render(scene).image()).astype(int)
            off = np.abs(found - wanted).max(axis=2) > 2
            inner = int((off & ~on_edges(wanted)).sum())
            own = unstable(renderer, scene, wanted) if inner else 0
            worst = max(worst, inner - own)
            size = target.stat().st_size / 1e3
            print(f"{name:20} {size:7.0f} {spent:10.1f} {off.sum():5} {inner:19} {off.size:11} {own:10}", flush=True)
            for width, height in ((1280, 720), (390, 844)):
                browser.resize(width, height, mobile=width < 700)
                wait = "new Promise((done) => { const end = Date.now() + 20000; const look = () => "
                wait += "raymarch.progress() > 0 || Date.now() > end ? done() : setTimeout(look, 100); "
                browser.run("new Promise((done) => setTimeout(done, 500))")
                browser.run(wait + "look(); })")
                browser.screenshot(given.out / f"{name}-{width}x{height}.png")
            browser.resize(1280, 720)
            for message in browser.messages:
                print(message)
            browser.messages.clear()
    return 1 if worst else 0


if __name__ == "__main__":
    sys.exit(main())
