"""Exported pages: their shaders are valid for WebGL 2, and in a browser they draw the picture of the renderer."""

from __future__ import annotations

import base64
import contextlib
import io
import re
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import raymarch as rm
from raymarch.errors import RaymarchError
from raymarch.gpu import Renderer
from raymarch.scene import load
from tests.export.test_shaders import EXAMPLES, SCENES, compare, page, picture
from tests.support import chromium
from tests.support.commands import files, run
from tests.support.required import glslang
from tests.support.surfaces import SURFACES

browsing = [
    pytest.mark.may_skip,
    pytest.mark.skipif(chromium.find() is None, reason="no Chromium is installed: install the package chromium"),
]

LIMIT = 60_000
"""Largest size of a page in bytes, without the data of textures."""


@pytest.fixture(scope="module")
def browser() -> Iterator[chromium.Browser]:
    with chromium.Browser(800, 450) as made:
        yield made


CASES = {**SCENES, "textures": load(EXAMPLES / "textures.py"), "columns": load(EXAMPLES / "columns.py")}


@pytest.mark.parametrize("name", ["parameters", "paths", "sky", "textures", "columns"])
def test_the_reference_compiler_takes_the_shaders(name: str, tmp_path: Path) -> None:
    _, data = page(CASES[name], tmp_path)
    texts = {
        "color": data["shader"],
        "geometry": data["shader"].replace("#define PASS 0", "#define PASS 1"),
        "display": data["display"],
    }
    assert texts["color"] != texts["geometry"]
    for key, text in texts.items():
        (tmp_path / f"{key}.frag").write_text(text)
        assert text.startswith("#version 300 es\n")
    done = subprocess.run(
        [glslang(), *(str(tmp_path / f"{key}.frag") for key in texts)], capture_output=True, text=True
    )
    assert done.returncode == 0, done.stdout


@pytest.mark.parametrize("name", CASES)
def test_a_page_is_small_and_needs_no_network(name: str, tmp_path: Path) -> None:
    file, data = page(CASES[name], tmp_path)
    text = file.read_text()
    assert len(text) - sum(len(t["bytes"]) for t in data["textures"]) - len(data["source"]) < LIMIT
    assert not re.search(r"(?:src|href|url|import|fetch)\s*[=(]", text.replace(data["source"], "").split("<body>")[0])
    head = text.partition("<body>")[0]
    assert not re.search("https?:", head) and "fetch(" not in text
    assert "Content-Security-Policy\" content=\"default-src 'none'" in head


def test_a_structure_is_not_chosen_by_a_conditional_operator(tmp_path: Path) -> None:
    """WebGL refuses it, though GLSL ES 3.00 and the reference compiler allow it."""
    solid = rm.sphere().material(rm.Material(color=(1, 0, 0))) | rm.box(1).translate((1, 0, 0))
    _, data = page(rm.Scene(solid, lights=[rm.Sun()]), tmp_path)
    assert "Material chosen(bool condition, Material yes, Material no)" in data["shader"]
    assert not re.search(r"\? Material\(", data["shader"])


def test_a_page_has_the_parameters_the_time_and_the_source(tmp_path: Path) -> None:
    _, data = page(CASES["columns"], tmp_path, params={"gap": 4.0}, time=1.5)
    gap = {"name": "gap", "uniform": "u_gap", "value": 4.0, "min": 2.2, "max": 5.0}
    assert data["params"] == [gap] and data["time"] == 1.5
    assert data["source"] == (EXAMPLES / "columns.py").read_text()
    _, data = page(rm.Scene(rm.sphere()), tmp_path)
    assert data["params"] == [] and data["time"] is None


def test_markup_in_the_source_does_not_end_the_data(tmp_path: Path) -> None:
    source = "import raymarch as rm\n# </script><script>alert(1)</script>\nscene = rm.sphere()\n"
    (tmp_path / "a & b.py").write_text(source)
    assert run("export", str(tmp_path / "a & b.py"), "-o", str(tmp_path / "made.html")) == 0
    text = (tmp_path / "made.html").read_text()
    assert "alert(1)</script>" not in text and "<title>a &amp; b</title>" in text
    assert page(load(tmp_path / "a & b.py"), tmp_path)[1]["source"] == source


def test_what_a_page_cannot_hold_is_refused(tmp_path: Path) -> None:
    still = [rm.PointLight((i, 2, 3)) for i in range(9)]
    _, data = page(rm.Scene(rm.sphere(), lights=still), tmp_path)
    assert [t["name"] for t in data["textures"]] == ["u_lights"]
    (tmp_path / "made.html").unlink()
    moving = rm.Scene(rm.sphere(), lights=[*still, rm.PointLight((rm.time, 2, 3))])
    with pytest.raises(RaymarchError, match=r"test_pages.py:\d+: 10 lights, one of which depends on time"):
        rm.export(moving, tmp_path / "made.html")
    assert not files(tmp_path)


LAND = rm.implicit(lambda p: p.y - rm.fbm(0.4 * p.xz, 2, noise="value"), ((-6, -1, -9), (6, 1, 4)))
AHEAD = {
    "implicit": rm.Scene(SURFACES["klein"].node()),
    "land": rm.Scene(LAND, rm.Camera((0, 1.6, 5), (0, 0.9, 0))),
    "displaced": rm.Scene(rm.sphere().displace(lambda p: 0.1 * rm.sin(8 * p.x) * rm.sin(8 * p.y))),
}
"""Solids that are known along stretches of a ray, and one that is not."""


class TestInABrowser:
    pytestmark = browsing

    @pytest.mark.parametrize("name", ["parameters", "framed", "textures", "sky", *AHEAD])
    def test_a_page_draws_the_picture(
        self, name: str, browser: chromium.Browser, renderer: Renderer, tmp_path: Path
    ) -> None:
        scene = (CASES | AHEAD)[name]
        browser.open(page(scene, tmp_path)[0])
        browser.run("raymarch.play(false), raymarch.state.time = 0.8")
        compare(browser.picture(64, 48).astype(int), picture(renderer, scene, 0.8))
        assert not browser.messages

    def test_samples_add_up(self, browser: chromium.Browser, renderer: Renderer, tmp_path: Path) -> None:
        browser.open(page(CASES["samples"], tmp_path)[0])
        compare(browser.picture(64, 48, samples=4).astype(int), picture(renderer, CASES["samples"]))

    def test_views_are_those_of_the_renderer(
        self, browser: chromium.Browser, renderer: Renderer, tmp_path: Path
    ) -> None:
        from raymarch.gpu import views

        browser.open(page(CASES["framed"], tmp_path)[0])
        renderer.forget()
        frame = renderer.render(CASES["framed"])
        for number, view in ((1, "depth"), (3, "normal")):
            wanted = np.asarray(views.picture(frame, view, CASES["framed"]))
            compare(browser.picture(64, 48, view=number).astype(int), wanted)
        assert browser.picture(64, 48, view=2).std() > 5

    def test_input_moves_the_picture(self, browser: chromium.Browser, tmp_path: Path) -> None:
        """A slider, dragging, the wheel, play and reset, by real events."""
        browser.open(page(CASES["parameters"], tmp_path)[0])
        browser.run("raymarch.play(false)")
        browser.run("document.querySelector('input[data-param=size]').focus()")
        browser.call("Input.dispatchKeyEvent", type="keyDown", key="End", code="End", windowsVirtualKeyCode=35)
        assert browser.run("raymarch.state.params.u_size") == 2.0
        browser.drag((400, 200), (460, 180))
        yaw, pitch, zoom = browser.run("raymarch.state.orbit")
        assert yaw == pytest.approx(-3.2 * 60 / 450) and pitch == pytest.approx(-3.2 * 20 / 450) and zoom == 0
        browser.drag((400, 200), (436, 200), modifiers=8)
        assert browser.run("raymarch.state.pan[0]") < 0
        browser.call("Input.dispatchMouseEvent", type="mouseWheel", x=400, y=200, deltaX=0, deltaY=100)
        browser.until("raymarch.state.orbit[2] !== 0")
        assert browser.run("raymarch.state.orbit[2]") == pytest.approx(0.12)
        browser.run("document.getElementById('play').click()")
        browser.until("raymarch.state.time > 0")
        browser.run("raymarch.play(false), document.getElementById('reset').click()")
        assert browser.run("[raymarch.state.time, ...raymarch.state.orbit, raymarch.state.params.u_size]") == [
            *(0, 0, 0, 0),
            1,
        ]

    def test_counts_have_a_bar_that_ends_at_their_99th_percentile(
        self, browser: chromium.Browser, tmp_path: Path
    ) -> None:
        """A few rays along a silhouette take many more evaluations than the others, and would darken all of them."""
        scene = rm.Scene(rm.sphere(1).twist(0.3) | rm.plane(offset=-1), quality=rm.Quality(analytic=False))
        browser.open(page(scene, tmp_path)[0])
        frame = rm.Renderer((160, 120)).render(scene, outputs=("evaluations",))
        counts = np.sort(frame.evaluations.ravel())
        assert counts[-1] > 1.5 * counts[int(0.99 * counts.size)]
        browser.picture(160, 120, view=2)
        most = int(browser.run("document.getElementById('most').textContent").split()[0])
        assert most == pytest.approx(counts[int(0.99 * counts.size)], rel=0.1)
        browser.run("document.getElementById('view').value = 2, document.getElementById('view').onchange()")
        browser.until("!document.getElementById('legend').hidden")
        bar = browser.run("[...document.getElementById('bar').getContext('2d').getImageData(0, 0, 160, 1).data]")
        assert len({tuple(bar[i : i + 3]) for i in range(0, 640, 4)}) > 50

    def test_a_narrow_page_shows_as_much_from_side_to_side(self, browser: chromium.Browser, tmp_path: Path) -> None:
        balls = [rm.sphere(0.8).translate((x, 0, 0)).material(rm.Material(emission=(9, 0, 0))) for x in (-1.6, 1.6)]
        browser.open(page(rm.Scene(balls[0] | balls[1], rm.Camera((0, 0, 7), (0, 0, 0))), tmp_path)[0])
        for size in ((96, 64), (45, 96)):
            red = (browser.picture(*size)[..., 0] > 200).any(axis=0)
            assert red.any() and not red[0] and not red[-1], size

    def test_without_webgl_there_is_a_picture_and_the_source(self, tmp_path: Path) -> None:
        with chromium.Browser(400, 300) as browser:
            none = "HTMLCanvasElement.prototype.getContext = () => null"
            browser.call("Page.addScriptToEvaluateOnNewDocument", source=none)
            browser.call("Page.navigate", url=page(CASES["columns"], tmp_path)[0].resolve().as_uri())
            browser.until("document.readyState === 'complete' && document.getElementById('fault').textContent")
            browser.until("document.getElementById('still').naturalWidth > 0")
            still = browser.run(
                "[document.getElementById('still').naturalWidth, document.getElementById('still').hidden]"
            )
            assert still[0] > 200 and still[1] is False
            assert "rm.Scene" in browser.run("document.getElementById('source').textContent")
            assert browser.run("document.getElementById('source').hidden") is False

    def test_shapes_are_shown_while_a_long_shader_is_compiled(
        self, browser: chromium.Browser, renderer: Renderer, tmp_path: Path
    ) -> None:
        file, _ = page(CASES["sky"], tmp_path)
        file.write_text(file.read_text().replace('"previewed":false', '"previewed":true'))
        seen = "window.seen = []; new MutationObserver(() => seen.push(document.getElementById('status')?.textContent))"
        seen += ".observe(document, { subtree: true, childList: true, characterData: true })"
        number = browser.call("Page.addScriptToEvaluateOnNewDocument", source=seen)["identifier"]
        try:
            browser.open(file)
        finally:
            browser.call("Page.removeScriptToEvaluateOnNewDocument", identifier=number)
        browser.until("raymarch.progress() > 1")
        texts = browser.run("seen")
        assert "compiling, a preview meanwhile" in texts and "sample" in texts[-1]
        compare(browser.picture(64, 48).astype(int), picture(renderer, CASES["sky"]))
        assert not browser.messages

    @pytest.mark.parametrize("base", [20, 60, 90])
    def test_a_picture_is_not_shrunk_where_that_hardly_helps(
        self, base: float, browser: chromium.Browser, tmp_path: Path
    ) -> None:
        """A turning torus in a software renderer takes 60 ms whatever the size, and 400 ms for the whole picture."""
        browser.open(page(CASES["framed"], tmp_path)[0])
        code = """(() => { const pace = new raymarch.Pace(), all = 1280 * 720; let share, spent;
            for (let i = 0; i < 25; i++) { share = pace.next(all); spent = BASE + 400 * share ** 2;
                pace.drawn(spent, all * share ** 2); } return [share, spent]; })()"""
        share, spent = browser.run(code.replace("BASE", str(base)))
        assert share > 0.2 and 1.5 * base < spent < 2.3 * base

    @pytest.mark.parametrize("odd", [0, 1, 2, 3, 5])
    @pytest.mark.parametrize("took", [1, 300])
    def test_one_frame_of_another_time_does_not_keep_a_picture_small(
        self, took: float, odd: int, browser: chromium.Browser, tmp_path: Path
    ) -> None:
        """The two parts of the time are learned again where the picture stays small."""
        browser.open(page(CASES["framed"], tmp_path)[0])
        code = """(() => { const pace = new raymarch.Pace(), all = 1280 * 720; let share, time = 0;
            for (let i = 0; time < 3000; i++) { share = pace.next(all);
                const spent = i === ODD ? TOOK : 35 + 120 * share ** 2; time += spent;
                pace.drawn(spent, all * share ** 2); } return pace.share; })()"""
        assert browser.run(code.replace("ODD", str(odd)).replace("TOOK", str(took))) > 0.4

    def test_the_address_keeps_the_state(self, browser: chromium.Browser, tmp_path: Path) -> None:
        """A link shows what was seen; one that was cut, or of another page, shows the start."""
        file = page(CASES["parameters"], tmp_path)[0]
        browser.open(file)
        browser.run("raymarch.play(false)")
        browser.drag((400, 200), (460, 180))
        browser.run("document.querySelector('input[data-param=size]').focus()")
        browser.call("Input.dispatchKeyEvent", type="keyDown", key="End", code="End", windowsVirtualKeyCode=35)
        kept = "JSON.parse(decodeURIComponent(location.hash.slice(1) || '{}'))"
        browser.until(f"{kept}.orbit?.join() === raymarch.state.orbit.join() && {kept}.params?.size === 2")
        address, orbit = browser.run("[location.href, raymarch.state.orbit]")
        assert orbit[0] != 0 and "#" in address
        other = f"{file.resolve().as_uri()}#%7B%22orbit%22:1%7D"
        for link, same in ((address, True), (address[:-20], False), (other, False)):
            browser.call("Page.navigate", url="about:blank")
            browser.call("Page.navigate", url=link)
            browser.until("window.raymarch")
            assert (browser.run("raymarch.state.orbit") == orbit) == same
            assert (browser.run("raymarch.state.params.u_size") == 2.0) == same

    def test_a_colour_is_picked_as_it_is_shown(self, browser: chromium.Browser, tmp_path: Path) -> None:
        tint = rm.Param("tint", (1.0, 0.1247718, 0.06301), 0, 1)
        browser.open(page(rm.Scene(rm.sphere().material(rm.Material(color=tint))), tmp_path)[0])
        color = "document.querySelector('input[data-color=tint]')"
        assert browser.run(f"{color}.value") == "#ff6347"
        browser.run(f"{color}.value = '#808000', {color}.dispatchEvent(new Event('input'))")
        assert browser.run("raymarch.state.params.u_tint") == pytest.approx([0.2158605, 0.2158605, 0], abs=1e-6)

    def test_a_picture_is_saved_and_the_screen_filled(self, browser: chromium.Browser, tmp_path: Path) -> None:
        browser.open(page(CASES["parameters"], tmp_path)[0])
        hooks = "window.files = []; URL.createObjectURL = (blob) => { files.push(blob); return 'blob:x'; }; "
        browser.run(hooks + "HTMLAnchorElement.prototype.click = function () { files.push(this.download); }")

        # as before the first frame
        start = "Object.assign(document.querySelector('canvas'), { width: 300, height: 150 }); "
        browser.run(start + "document.getElementById('save').click()")
        browser.until("files.length === 2")
        code = "files[0].arrayBuffer().then((b) => btoa(String.fromCharCode(...new Uint8Array(b))))"
        saved = Image.open(io.BytesIO(base64.b64decode(browser.run(code))))
        assert saved.size == (800, 450) and len(saved.getcolors(1 << 20) or ()) > 100
        assert browser.run("files[1]").endswith(".png")
        place = "document.getElementById('full').getBoundingClientRect()"
        x, y = browser.run(f"[{place}.x + 9, {place}.y + 9]")
        browser.drag((x, y), (x, y))
        browser.until("document.fullscreenElement")
        browser.run("document.exitFullscreen()")


def test_the_keyboard_turns_the_picture_and_a_lost_device_comes_back(browser: chromium.Browser, tmp_path: Path) -> None:
    """With the state that the page had."""
    browser.open(page(rm.Scene(rm.sphere()), tmp_path)[0])
    browser.run("canvas.focus(); 0")
    for key in ("ArrowLeft", "ArrowUp", "+"):
        text = {"text": key} if key == "+" else {}
        browser.call("Input.dispatchKeyEvent", type="keyDown", key=key, **text)
        browser.call("Input.dispatchKeyEvent", type="keyUp", key=key)
    turned = browser.run("raymarch.state.orbit.slice()")
    assert turned == pytest.approx([0.096, -0.096, -0.1])
    browser.run(
        "window.device = canvas.getContext('webgl2').getExtension('WEBGL_lose_context'); device.loseContext(); 0"
    )
    browser.until("document.getElementById('fault').textContent")
    browser.run("device.restoreContext(); 0")
    until, found = time.monotonic() + chromium.LIMIT, None
    while not found and time.monotonic() < until:
        time.sleep(0.02)
        with contextlib.suppress(RuntimeError):  # while it is loaded again
            found = browser.run("window.device ? null : window.raymarch?.state.orbit.slice()")
    assert found == pytest.approx(turned)
