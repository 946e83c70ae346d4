"""Random invocations of the command: odd names and places, full and read-only disks, streams, encodings, signals.

python -m tests.lab.invocations [--count 200] [--seed 1] [--only N] [--keep] [--verbose]

Each is judged by four rules: no traceback; exit status 0, 2 or 130; the output whole, or as it was before; no other
file changed, removed or left behind, except the frames of a film that was interrupted. As root on Linux, permissions
hold for the commands too, and small and read-only disks are mounted where nobody else sees them.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import resource
import shutil
import signal
import stat
import subprocess
import sys
import tempfile
import time
from collections import Counter
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from PIL import Image, ImageSequence

import raymarch

ROOT = Path(raymarch.__file__).parents[1]
NAMES = (
    "scene", "two words", "ünï→☃", "-dash", "%d", "{}", "{0.x}", "quo'te\"s", "new\nline", "tab\tbell\a", "\x1b[31mred",
    "$\\frac$", "DATA", "TITLE", "\udcff\udcfe", "x" * 245, "[b]", ":100:", "#?&", ".hidden", "con", "import", "a.b.c",
)  # fmt: skip
SCENES = {
    "ball": "scene = rm.sphere(1) | rm.box(1.2)\n",
    "moving": "scene = rm.sphere(1).translate((rm.time, 0, 0))\n",
    "lit": "scene = rm.Scene((rm.sphere(1) | rm.plane(offset=-1)).material(rm.Material((.8, .2, .1))))\n",
    "many": "scene = rm.union(*[rm.sphere(.1).translate((.3 * (i % 9), .3 * (i // 9), 0)) for i in range(81)])\n",
    "prints": "print('hello \\u2603')\nscene = rm.sphere(1)\n",
    "wrong": "scene = rm.sphere(-1)\n",
    "none": "ball = rm.sphere(1)\n",
    "broken": "scene = rm.sphere(1\n",
    "raises": "raise ValueError('bad\\x1b[2J \\u2603\\nline')\n",
    "slow": "import time\nfor _ in range(20): time.sleep(.1)\nscene = rm.sphere(1)\n",
}
STILLS = (".png", ".jpg", ".webp", ".tif", ".bmp", ".npz")
FILMS = (".gif", ".mp4", ".webm")
EXPORTS = (".glsl", ".html", ".wgsl", ".obj", ".ply", ".stl")
PLACES = (
    "new", "new", "new", "new", "old", "old", "read-only file", "link", "loose link", "endless link", "linked folder",
    "folder", "pipe", "full device", "missing folder", "file as folder", "read-only folder", "full disk", "full disk",
    "read-only disk", "small files",
)  # fmt: skip
STREAMS = ("pipes", "pipes", "pipes", "no stdout", "no stderr", "no stdin", "none", "full stdout", "closed pipe")
ENCODINGS: tuple[dict[str, str], ...] = (
    {}, {}, {"LC_ALL": "C"}, {"LC_ALL": "C.UTF-8"}, {"PYTHONIOENCODING": "ascii"}, {"PYTHONIOENCODING": "latin-1"},
    {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}, {"LC_ALL": "xx_YY.UTF-8"},
)  # fmt: skip
SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


@dataclass
class Case:
    """One invocation. folder : has the scene, and is where the command runs. output : its name for the command."""

    number: int
    folder: Path
    arguments: list[str] = field(default_factory=list)
    output: str = ""
    frames: int = 0
    place: str = "new"
    streams: str = "pipes"
    encoding: dict[str, str] = field(default_factory=dict)
    signals: list[tuple[float, signal.Signals]] = field(default_factory=list)
    twice: bool = False
    disk: Path | None = None

    @property
    def words(self) -> str:
        sent = [f"{number.name} after {after:.2f} s" for after, number in self.signals]
        return ", ".join(
            [f"{self.arguments}", self.place, self.streams, f"{self.encoding}", *sent, "twice" * self.twice]
        )


def made(number: int, seed: int, root: Path) -> Case:
    """A random case, with its files."""
    dice = random.Random(f"{seed} {number}")
    top = root / f"{number}"
    folder = top / dice.choice(NAMES if dice.random() < 0.4 else ("plain",))
    folder.mkdir(parents=True)
    case = Case(number, folder)
    scene = folder / f"{dice.choice(NAMES if dice.random() < 0.4 else ('scene',))}.py"
    scene.write_text(
        "import raymarch as rm\n" + SCENES[dice.choice([*SCENES, "ball", "moving", "lit"])], encoding="utf-8"
    )
    stem = dice.choice(NAMES) if dice.random() < 0.3 else "out"
    kind = dice.choice(("still", "still", "sequence", "film", "film", "film", "export", "explain"))
    named = dice.choice([scene.name, str(scene), f"./{scene.name}", f"{folder}/../{folder.name}/{scene.name}"])
    words = ["explain", named] if kind == "explain" else ["export" if kind == "export" else "render", named]
    case.place = dice.choice(PLACES) if kind != "explain" else "new"
    if kind == "explain":
        words += dice.choice(([], ["--json"], ["--glsl"]))
    else:
        suffix = dice.choice({"still": STILLS, "sequence": STILLS, "film": FILMS, "export": EXPORTS}[kind])
        if kind == "sequence":
            stem += dice.choice(("_{:03d}", "_%d", "_{{}}"))
        case.output = _placed(case, f"{stem}{suffix}", dice)
        words += ["-o", case.output]
        if kind != "export":
            words += ["--size", f"{2 * dice.randint(1, 24)}x{2 * dice.randint(1, 16)}"]
        if kind in ("film", "sequence"):
            case.frames = dice.randint(1, 6)
            words += ["--frames", f"0:{case.frames}", "--fps", dice.choice(("30", "24", "0.5"))]
    if words[1].startswith("-"):
        words.insert(1, "--")
        words = [words[0], *words[3:], *words[1:3]]
    case.arguments = words
    case.streams = dice.choice(STREAMS)
    case.encoding = dice.choice(ENCODINGS)
    if dice.random() < 0.35:
        case.signals = sorted((dice.random() ** 2 * 2.5, dice.choice(SIGNALS)) for _ in range(dice.choice((1, 1, 2))))
    case.twice = kind == "film" and dice.random() < 0.2
    return case


def _placed(case: Case, name: str, dice: random.Random) -> str:
    """Make the place of the output, with files of the user in it. Returns the name of the output."""
    folder = case.folder
    (folder / "notes.txt").write_text("mine")
    (folder / "out.npz").write_text("mine")
    for parts in ("frames", "tiles"):
        if dice.random() < 0.5:
            with suppress(OSError):  # of a name that is too long
                (folder / f"{name}.{parts}").mkdir()
                for other in ("frame_000000.png", "tile_000000_000000.png", "mine"):
                    (folder / f"{name}.{parts}" / other).write_text("mine")
    file, place = folder / name, case.place
    real = folder / "real.dat"
    with suppress(OSError):
        if place in ("old", "read-only file"):
            file.write_text("old")
            file.chmod(0o444 if place == "read-only file" else dice.choice((0o600, 0o644, 0o640)))
        elif place == "link":
            real.write_text("old")
            file.symlink_to("real.dat")
        elif place == "loose link":
            file.symlink_to("real.dat")
        elif place == "endless link":
            file.symlink_to(name)
        elif place == "folder":
            file.mkdir()
        elif place == "pipe":
            os.mkfifo(file)
        elif place == "full device":
            file.symlink_to("/dev/full")
    other = folder / "place"
    if place == "missing folder":
        return f"place/{name}"
    if place == "file as folder":
        other.write_text("mine")
        return f"place/{name}"
    if place in ("linked folder", "read-only folder", "full disk", "read-only disk"):
        (folder / "away" if place == "linked folder" else other).mkdir()
        if place == "linked folder":
            other.symlink_to("away")
        if place.endswith("disk") and os.geteuid() == 0:
            size = dice.choice((4, 8, 16, 48))
            subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={size}k,mode=777", "raymarch", other], check=True)
            case.disk = other
            (other / "notes.txt").write_text("mine")
            if place == "read-only disk":
                subprocess.run(["mount", "-o", "remount,ro", other], check=True)
        if place == "read-only folder":
            other.chmod(0o555)
        return f"place/{name}"
    return name if dice.random() < 0.8 else str(file)


State = dict[str, tuple[int, str, bytes]]


def state(folder: Path) -> State:
    """Mode, link and content of everything in a folder."""
    found: State = {}
    for where, folders, files in os.walk(folder):
        for name in [*folders, *files]:
            path = os.path.join(where, name)
            facts = os.lstat(path)
            link = os.readlink(path) if stat.S_ISLNK(facts.st_mode) else ""
            content = Path(path).read_bytes() if stat.S_ISREG(facts.st_mode) else b""
            if "__pycache__" not in path:
                found[os.path.relpath(path, folder)] = facts.st_mode, link, content
    return found


def start(case: Case, again: bool = False) -> subprocess.Popen[bytes]:
    environment = {name: value for name, value in os.environ.items() if not name.startswith(("LC_", "LANG", "PYTHON"))}
    environment |= {"PYTHONPATH": str(ROOT), "HOME": str(case.folder.parents[1]), "PYTHONDONTWRITEBYTECODE": "1"}
    environment |= {"RAYMARCH_CACHE": str(case.folder.parents[1] / "cache"), **case.encoding}
    environment["PYTHONDONTWRITEBYTECODE"] = "1"  # Python does not notice that its own file is cut
    command = [sys.executable, "-m", "raymarch", *case.arguments]
    streams = case.streams if not again else "pipes"
    closed = {"no stdout": (1,), "no stderr": (2,), "no stdin": (0,), "none": (0, 1, 2)}.get(streams, ())

    def prepare() -> None:
        for number in SIGNALS:
            signal.signal(number, signal.SIG_DFL)
        for number in closed:
            os.close(number)
        if case.place == "small files":
            resource.setrlimit(resource.RLIMIT_FSIZE, (300, 300))

    gone = None
    out: int = subprocess.PIPE
    if streams == "full stdout":
        out = gone = os.open("/dev/full", os.O_WRONLY)
    elif streams == "closed pipe":
        end, out = os.pipe()
        gone = out
        os.close(end)
    if os.geteuid() == 0:
        command = ["setpriv", "--bounding-set", "-dac_override,-dac_read_search,-fowner", *command]
    process = subprocess.Popen(
        [os.fsencode(word) for word in command], env=environment, cwd=case.folder, stdin=subprocess.DEVNULL, stdout=out,
        stderr=subprocess.PIPE, preexec_fn=prepare,
    )  # type: ignore[call-overload]  # fmt: skip
    if gone is not None:
        os.close(gone)
    return process


def send(case: Case, process: subprocess.Popen[bytes]) -> None:
    """Send the signals, from the moment on when the command handles them: before, Python itself starts."""
    caught = 0
    while process.poll() is None and not caught >> (signal.SIGHUP - 1) & 1:
        with suppress(OSError, IndexError):
            caught = int(Path(f"/proc/{process.pid}/status").read_text().split("SigCgt:")[1].split()[0], 16)
        time.sleep(0.002)
    begun = time.monotonic()
    for after, number in case.signals:
        while process.poll() is None and time.monotonic() - begun < after:
            time.sleep(0.002)
        if process.poll() is None:
            process.send_signal(number)


def judged(case: Case) -> tuple[list[int], list[str]]:
    """Run a case. Returns the exit statuses, and what is wrong."""
    before = state(case.folder)
    reader = None
    if case.place == "pipe" and os.path.exists(case.folder / case.output):
        reader = subprocess.Popen(["cat", case.folder / case.output], stdout=subprocess.DEVNULL)
    processes = [start(case), *([start(case, again=True)] if case.twice else [])]
    send(case, processes[0])
    faults, codes = [], []
    for process in processes:
        try:
            out, err = process.communicate(timeout=120)
        except subprocess.TimeoutExpired:
            process.kill()
            out, err = process.communicate()
            faults.append("it does not end")
        codes.append(process.returncode)
        said = (out or b"") + err
        for word in (b"Traceback (most", b"Exception ignored", b"Fatal Python", b"Segmentation"):
            if word in said:
                faults.append(f"{word.decode()}: {said[-700:].decode(errors='replace')}")
        if process.returncode not in (0, 2, 130) and not any("Traceback" in fault for fault in faults):
            faults.append(f"exit status {process.returncode}: {said[-300:].decode(errors='replace')}")
        if process.returncode == 2 and case.streams in ("pipes", "no stdin") and err.count(b"raymarch: ") < 1:
            faults.append(f"exit status 2 without a reason: {err[-300:]!r}")
        if "--json" in case.arguments and process.returncode == 0 and case.streams in ("pipes", "no stdin"):
            with suppress(ValueError):
                json.loads(out)
                continue
            faults.append(f"no JSON: {out[:80]!r}")
    if reader is not None:
        reader.kill()
        reader.wait()
    return codes, faults + changes(case, before, state(case.folder), codes)


def changes(case: Case, before: State, after: State, codes: list[int]) -> list[str]:
    """What the files say: outputs that are not whole, and other files that changed."""
    faults, outputs = [], set()
    if case.output:
        target = Path(os.path.normpath(case.folder / case.output))
        names = [target.name]
        if case.frames and target.suffix not in FILMS:
            names = [_numbered(target.name, i) for i in range(case.frames)]
        outputs = {
            os.path.relpath(os.path.realpath(target.with_name(name)), os.path.realpath(case.folder)) for name in names
        }
        for name in sorted(outputs):
            if 0 in codes and case.place != "pipe" and after.get(name) == before.get(name):
                faults.append(f"status 0 without {name!r}")
            if name in after and after[name] != before.get(name) and stat.S_ISREG(after[name][0]):
                if fault := broken(case.folder / name, target.suffix, case.frames):
                    faults.append(f"{name!r} is not whole: {fault}")
                if name in before and stat.S_IMODE(before[name][0]) != stat.S_IMODE(after[name][0]):
                    faults.append(f"the mode of {name!r} changed")
    for name in sorted(before.keys() | after.keys()):
        if name in outputs or before.get(name) == after.get(name):
            continue
        in_parts = f"{os.path.basename(case.output)}.frames" in name.split(os.sep)
        if name not in before and in_parts and any(codes) and "/.raymarch." not in name:
            continue  # frames of an interrupted film
        what = "left" if name not in before else "removed" if name not in after else "changed"
        faults.append(f"{what}: {name!r}")
    return faults


def _numbered(name: str, number: int) -> str:
    for form in (name.format, name.__mod__):
        with suppress(LookupError, ValueError, TypeError, AttributeError):
            if form(number) != form(number + 1):
                return str(form(number))
    return name


def broken(file: Path, suffix: str, frames: int) -> str:
    """Why an output is not whole; "" if it is."""
    try:
        if suffix == ".npz":
            with np.load(file) as arrays:
                return "" if all(arrays[name].size for name in arrays.files) else "an empty array"
        if suffix in (".mp4", ".webm"):
            import av

            with av.open(str(file)) as film:
                count = sum(1 for _ in film.decode(video=0))
            return "" if count == frames else f"{count} of {frames} frames"
        if suffix in EXPORTS:
            return "" if file.stat().st_size > 80 else "too short"
        with Image.open(file) as picture:
            for frame in ImageSequence.Iterator(picture):
                frame.load()
    except Exception as fault:
        return f"{type(fault).__name__}: {fault}"
    return ""


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", type=int, help="run this case alone")
    parser.add_argument("--keep", action="store_true", help="keep the files")
    parser.add_argument("--verbose", action="store_true", help="print each case")
    given = parser.parse_args()
    if os.geteuid() == 0 and "RAYMARCH_UNSHARED" not in os.environ:  # mounts that nobody else sees
        environment = os.environ | {"RAYMARCH_UNSHARED": "1"}
        os.execvpe(
            "unshare", ["unshare", "-m", sys.executable, "-m", "tests.lab.invocations", *sys.argv[1:]], environment
        )
    root = Path(tempfile.mkdtemp(prefix="raymarch-invocations-"))
    root.chmod(0o777)
    statuses: Counter[int] = Counter()
    wrong = 0
    try:
        for number in range(given.count) if given.only is None else [given.only]:
            os.umask(0)
            case = made(number, given.seed, root)
            os.umask(0o022)
            begun = time.monotonic()
            codes, faults = judged(case)
            statuses.update(codes)
            if given.verbose:
                print(f"{number}: {codes} {time.monotonic() - begun:.1f} s, {case.words}", flush=True)
            if faults:
                wrong += 1
                print(f"{number}: {case.words}", *faults, sep="\n    ", flush=True)
            if case.disk is not None:
                subprocess.run(["umount", case.disk], check=True)
            if not given.keep:
                shutil.rmtree(case.folder.parent, ignore_errors=True)
    finally:
        if not given.keep:
            shutil.rmtree(root, ignore_errors=True)
    shown = ", ".join(f"{count} ended with {code}" for code, count in sorted(statuses.items()))
    print(f"{given.count if given.only is None else 1} invocations, seed {given.seed}: {wrong} wrong; {shown}")
    return bool(wrong)


if __name__ == "__main__":
    sys.exit(main())
