"""Films, pictures and costs on a real scheduler with real workers: the bytes of the plain command, whatever fails."""

from __future__ import annotations

import json
import os
import shutil
import signal
import time
from collections.abc import Callable, Iterator
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import dask
import distributed
import matplotlib
import pytest

import raymarch as rm
from raymarch.cli import drawing
from raymarch.cli.common import CommandError
from raymarch.cluster import connect, frames, submit
from raymarch.cluster.connect import connected
from raymarch.cluster.source import of_file
from raymarch.cluster.submit import Cluster, Options
from raymarch.cluster.sweep import Moment, sweep_on
from raymarch.cost.effects import evaluations_of
from raymarch.cost.reference import reference
from raymarch.cost.settings import Setting
from raymarch.cost.sweep import sweep
from raymarch.cost.text import as_json, findings
from raymarch.errors import ClusterError
from tests.support.commands import files, run
from tests.support.dask_processes import Way

SCENE = """import raymarch as rm
from colors import RED
ball = rm.sphere(0.5).translate((rm.time - 1, 0, 0)).material(rm.Material(color=RED))
scene = rm.Scene(ball | rm.plane(offset=-0.5), camera=rm.Camera((0, 1, 5), (0, 0, 0)))
"""
SIGNS = """import raymarch as rm
from parts import ball
left = ball().translate((rm.time - 1, 0, 0))
sign = rm.text("A", font="own.ttf").extrude(0.2).material(rm.Material(color=(1, 0.2, 0.1)))
scene = rm.Scene(left | sign.translate((0.7, 0, 0)) | rm.plane(offset=-0.5), camera=rm.Camera((0, 1, 5), (0, 0, 0)))
"""
SERIF = Path(matplotlib.get_data_path()) / "fonts" / "ttf" / "DejaVuSerif.ttf"
SIZE = "32x24"
TLS = ("tls_ca_file", "tls_client_key", "tls_client_cert")


@pytest.fixture(scope="module")
def client() -> Iterator[Any]:
    """A client of a scheduler with two worker processes, which replaces a worker that does not answer in a minute.

    Its certificate is in Dask's configuration, so that commands find it, as they find that of a user's own cluster.
    """
    with connected("local:2", 60.0) as made:
        known = made.security
        names = {"ca-file": known.tls_ca_file, "client.key": known.tls_client_key, "client.cert": known.tls_client_cert}
        with dask.config.set({f"distributed.comm.tls.{name}": value for name, value in names.items()}):
            yield made


@pytest.fixture(autouse=True)
def _both_workers(client: Any) -> None:
    """A worker that a test stopped is replaced by the scheduler, which takes a moment."""
    client.wait_for_workers(2, timeout=60)


@pytest.fixture
def cluster(client: Any) -> tuple[str, str]:
    return "--cluster", str(client.scheduler.address)


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "ball.py").write_text(SCENE)
    (tmp_path / "colors.py").write_text("RED = (1, 0.2, 0.1)\n")
    return tmp_path


def test_a_client_without_the_certificate_is_refused(client: Any) -> None:
    """Whoever reaches the scheduler or a worker could run code as the user."""
    addresses = [client.scheduler.address, *client.scheduler_info(n_workers=-1)["workers"]]
    assert len(addresses) == 3 and all(address.startswith("tls://127.0.0.1:") for address in addresses)
    plain = [distributed.Security(require_encryption=False, **dict.fromkeys(TLS)), "tcp"]
    for security, protocol in ((distributed.Security.temporary(), "tls"), plain):
        for address in addresses:
            with pytest.raises((OSError, TimeoutError)):
                distributed.Client(f"{protocol}{address[3:]}", security=security, timeout=1, set_as_default=False)


def test_ctrl_c_is_left_to_the_command(client: Any) -> None:
    """It reaches all processes of a terminal; workers that are interrupted would print tracebacks."""
    blocked = client.run(signal.pthread_sigmask, signal.SIG_BLOCK, [])
    assert len(blocked) == 2 and all(signal.SIGINT in found for found in blocked.values())


def test_a_worker_that_dies_while_it_starts_is_started_again() -> None:
    fault = RuntimeError("Nanny failed to start.")
    tries: list[Any] = [fault, fault, "a cluster"]

    def start(**options: Any) -> Any:
        if isinstance(found := tries.pop(0), Exception):
            raise found
        return found

    assert connect._started(start, {"n_workers": 2}) == "a cluster" and not tries
    tries += [fault] * connect.STARTS
    with pytest.raises(ClusterError, match=r"the workers do not start: Nanny failed to start\. \(raymarch doctor\)"):
        connect._started(start, {})
    assert not tries


def draw(output: str, *more: str, frames: str = "0:6") -> int:
    return run("render", "ball.py", "-o", output, "--frames", frames, "--fps", "6", "--size", SIZE, *more)


def content(pattern: str) -> list[bytes]:
    """The bytes of the files of a pattern, in the order of their names."""
    return [file.read_bytes() for file in sorted(Path().glob(pattern))]


def test_films_pictures_and_failures(
    folder: Path, cluster: tuple[str, str], capsys: pytest.CaptureFixture[str]
) -> None:
    assert draw("p%d.png") == 0 and draw("c%d.png", *cluster) == 0
    assert content("c*.png") == content("p*.png") and len(content("c*.png")) == 6
    told = capsys.readouterr().err
    assert told.count(" ms to draw") == 12 and "6 frames in" in told and "s of work" in told
    (folder / "c2.png").write_bytes(b"")
    assert draw("c%d.png", *cluster) == 0 and content("c*.png") == content("p*.png")
    assert capsys.readouterr().err.count(" ms to draw") == 1

    assert draw("p.gif") == 0 and draw("c.gif", *cluster, "--batch", "4") == 0
    assert content("c.gif") == content("p.gif") and not (folder / "c.gif.frames").exists()

    still = ("render", "ball.py", "--size", "70x40", "--samples", "2")
    assert run(*still, "-o", "p.png") == 0 and run(*still, "-o", "c.png", *cluster) == 0
    assert content("c.png") == content("p.png") and not (folder / "c.png.tiles").exists()
    assert run(*still, "-o", "s.png", *cluster, "--split-samples", "2") == 0 and len(content("s.png")[0]) > 500

    capsys.readouterr()
    (folder / "ball.py").write_text(SCENE.replace("(0, 1, 5), (0, 0, 0)", "(rm.time * 6 - 2, 0, 0), (1, 0, 0)"))
    assert draw("f%d.png", *cluster) == 2
    told = capsys.readouterr().err
    assert sorted(files(folder) & {f"f{i}.png" for i in range(6)}) == [f"f{i}.png" for i in (0, 1, 2, 4, 5)]
    assert "raymarch: frame 3 cannot be drawn: ball.py:4: " in told
    assert told.splitlines()[-1] == "raymarch: 1 of 6 frames could not be drawn (see above)"


def test_what_is_drawn_already_starts_no_cluster(
    folder: Path, cluster: tuple[str, str], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def lost(*_: Any) -> None:
        raise CommandError("no disk")

    with monkeypatch.context() as broken:
        broken.setattr(drawing, "join_film", lost)
        assert draw("c.gif", *cluster) == 2 and len(list(folder.glob("c.gif.frames/*"))) == 6
    assert draw("p%d.png") == 0 and draw("p.gif") == 0
    drawn = content("p*.png")
    monkeypatch.setattr(connect, "_local", lambda *_: pytest.fail("a cluster starts"))
    capsys.readouterr()
    assert draw("p%d.png", "--cluster", "local:1") == 0 and content("p*.png") == drawn
    assert capsys.readouterr().err.count("is already drawn") == 6
    assert draw("c.gif", "--cluster", "local:1") == 0 and content("c.gif") == content("p.gif")
    (folder / "p2.png").write_bytes(b"")
    with pytest.raises(pytest.fail.Exception, match="a cluster starts"):
        draw("p%d.png", "--cluster", "local:1")


def test_a_scene_is_drawn_wherever_its_file_lies(folder: Path, client: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """By its absolute path, from another folder and through a linked folder, with a sibling and a font beside it."""
    here = folder / "two words"
    here.mkdir()
    shutil.copy(SERIF, here / "own.ttf")
    (here / "parts.py").write_text("import raymarch as rm\ndef ball():\n    left = rm.sphere(0.5)\n    return left\n")
    (here / "signs.py").write_text(SIGNS)
    (folder / "linked").symlink_to(here)
    (folder / "other").mkdir()
    monkeypatch.chdir(folder / "other")
    drawn = []
    for k, path in enumerate((here / "signs.py", here / "signs.py", "../two words/signs.py", "../linked/signs.py")):
        made = rm.render_frames(path, range(2), 2, (32, 24), f"{k}_{{}}.png", None if k == 0 else client)
        drawn.append([file.read_bytes() for file in made])
    assert drawn[1:] == drawn[:1] * 3 and len(set(drawn[0])) == 2


def after_frame(number: int, disturb: Callable[[], object], monkeypatch: pytest.MonkeyPatch) -> None:
    """Call a function before the file of the frame of this number, in the order of their arrival, is written."""
    written, arrived = frames.written, []

    def counted(file: Path, *more: Any) -> Any:
        arrived.append(file)
        if len(arrived) == number:
            disturb()
        return written(file, *more)

    monkeypatch.setattr(frames, "written", counted)


@pytest.mark.parametrize("also_hung", [False, True], ids=["killed", "killed and hung"])
def test_a_killed_and_a_hung_worker_cost_only_their_tasks(
    folder: Path, client: Any, also_hung: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert draw("p_%02d.png", frames="0:24") == 0
    with connected("local:2", 5.0) if also_hung else nullcontext(client) as used:
        first, second = used.run(os.getpid).values()

        def disturb() -> None:
            os.kill(first, signal.SIGKILL)
            if also_hung:
                os.kill(second, signal.SIGSTOP)  # the scheduler replaces it after its time to live

        after_frame(4, disturb, monkeypatch)
        made = rm.render_frames("ball.py", range(24), 6, (32, 24), "c_{:02d}.png", used)
    assert [file.name for file in made] == [f"c_{i:02d}.png" for i in range(24)]
    assert content("c_*.png") == content("p_*.png")


def test_the_cost_has_the_same_errors_and_evaluations(folder: Path, client: Any) -> None:
    source, scene = of_file("ball.py")
    settings = [Setting("base", scene.quality), Setting("plain", scene.quality.replace(tracer="plain"))]
    moment = Moment((24, 16), 0.5, {}, 1)
    options, quiet = Options(timeout=60.0), lambda *_: None
    found = sweep_on(Cluster(client), source, scene, settings, moment, "ball", 1, 1, options, quiet, quiet)
    with rm.Renderer(moment.size) as renderer:
        known = reference(scene, moment.size, moment.time, {}, 1)
        plain = sweep(scene, settings, known, renderer, "ball", moment.time, {}, 1, count=evaluations_of)
    for one, other in zip(found.points, plain.points, strict=True):
        assert repr(one.errors) == repr(other.errors) and one.evaluations == other.evaluations
        assert (one.name, one.tracer, one.iterations) == (other.name, other.tracer, other.iterations)
        assert not one.times and one.time.count == 0
    assert found.points[0].all_evaluations == plain.points[0].all_evaluations
    text = "\n".join(findings(found))
    assert "no times: more than one worker runs on each machine" in text and "fewer evaluations" in text
    assert json.loads(as_json(found))["points"][0]["milliseconds"]["median"] is None


def test_a_lost_scheduler_is_one_line_and_the_film_continues(
    folder: Path, client: Any, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], caplog: Any
) -> None:
    """The way to the scheduler is cut after the third frame, before the workers are counted: what is open ends, and
    nobody answers there any more."""
    monkeypatch.setattr(submit, "COUNTED", 0.0)
    client_of = distributed.Client

    def hasty(address: str, **options: Any) -> Any:
        """A client that connects in its own time, and then looks for a lost scheduler for a second only."""
        found = client_of(address, **options)
        found._timeout = 1.0
        return found

    monkeypatch.setattr(distributed, "Client", hasty)
    assert draw("p_%02d.png", frames="0:40") == 0
    with Way(client.scheduler.address) as way:
        after_frame(3, way.cut, monkeypatch)
        assert draw("c_%02d.png", "--cluster", way.address, frames="0:40") == 2
    told = capsys.readouterr().err
    lost = "raymarch: the connection to the scheduler is lost; what was drawn is kept (the same command again)"
    assert lost in told and not caplog.records
    kept = len(content("c_*.png"))
    assert 3 <= kept < 40
    started = time.time_ns()
    assert draw("c_%02d.png", frames="0:40") == 0
    assert content("c_*.png") == content("p_*.png")
    assert sum(file.stat().st_mtime_ns > started for file in folder.glob("c_*.png")) == 40 - kept
