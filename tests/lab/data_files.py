"""Mutates files of data, and judges how they are read.

python -m tests.lab.data_files                                 # 300 mutations of each kind
python -m tests.lab.data_files --count 50 --kinds png glb --seed 7

Each kind is read in forked processes. A mutation is at fault if its process dies, takes 20 s of CPU time or more memory
than 1 GiB, raises anything but a `RaymarchError`, or has a message of several lines or without the file's name. A file
of the cache is at fault too if what is read differs from what was stored.
"""

from __future__ import annotations

import argparse
import contextlib
import dataclasses
import json
import os
import random
import resource
import signal
import sys
import tempfile
import warnings
import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from PIL import Image, ImageFont

import raymarch as rm
from raymarch.cost import baseline
from raymarch.errors import RaymarchError
from raymarch.files import read_json, reading
from raymarch.plan import kept_cells
from raymarch.plan.gather import gather
from raymarch.prices import STANDARD
from raymarch.scene.file import load
from raymarch.scene.quality import PRESETS, Quality
from raymarch.sdf.meshes import mesh
from raymarch.window.accuracy import measured_stops
from raymarch.window.state import SAVED_SETTINGS
from raymarch.window.state import opened as opened_state

SECONDS, BYTES = 20, 1 << 30

Make = Callable[[Path], Path]
Use = Callable[[Path], object]


def picture(name: str, mode: str = "RGB", side: int = 24, **options: Any) -> Make:
    """Writes a picture of noise by Pillow."""

    def make(folder: Path) -> Path:
        noise = np.random.default_rng(1).integers(0, 256, (side, side, 4), np.uint8)
        image = Image.fromarray(noise, "RGBA").convert(mode)
        if mode == "I;16":
            image = Image.fromarray(noise[..., 0].astype(np.uint16) * 257)
        image.save(folder / name, **options)
        return folder / name

    return make


def hdr(folder: Path) -> Path:
    """A Radiance picture, run-length encoded."""
    row = b"\2\2\0\x10" + b"".join(bytes([0x88, v, 8, *range(8)]) for v in (90, 80, 70, 128))
    (folder / "a.hdr").write_bytes(b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 12 +X 16\n" + 12 * row)
    return folder / "a.hdr"


def exr(folder: Path) -> Path:
    from raymarch.expr.images import write_channels

    write_channels(folder / "a.exr", {"RGB": np.random.default_rng(1).uniform(0, 2, (16, 24, 3))})
    return folder / "a.exr"


def solid(name: str, part: str = "", **options: Any) -> Make:
    """Writes a ball by trimesh. part : the one of its files that is mutated."""

    def make(folder: Path) -> Path:
        ball = trimesh.creation.icosphere(1)
        if name.endswith(".gltf"):
            for other, content in trimesh.exchange.gltf.export_gltf(trimesh.Scene(ball)).items():
                (folder / other).write_bytes(content)
            return folder / "model.gltf"
        ball.export(folder / name, **options)
        return folder / name

    return make


def obj_with_material(folder: Path) -> Path:
    file = solid("a.obj")(folder)
    file.write_text("mtllib a.mtl\nusemtl one\n" + file.read_text())
    (folder / "a.mtl").write_text("newmtl one\nKd 1 0 0\n")
    return file


def zipped(folder: Path) -> Path:
    with zipfile.ZipFile(folder / "a.zip", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.write(solid("a.stl")(folder), "a.stl")
    return folder / "a.zip"


def font(folder: Path) -> Path:
    found = ImageFont.load_default(20)
    assert isinstance(found, ImageFont.FreeTypeFont)
    found.path.seek(0)  # type: ignore[union-attr]  # a stream
    (folder / "a.ttf").write_bytes(found.path.read())  # type: ignore[union-attr]
    return folder / "a.ttf"


def stored(name: str, content: Callable[[], Any]) -> Make:
    def make(folder: Path) -> Path:
        (folder / name).write_text(json.dumps(content()))
        return folder / name

    return make


def a_baseline() -> Any:
    row = {"missed": 0, "false": 0, "evaluations": 9.0, "pixels_p50": 0.1, "pixels_p99": 0.2, "normal_p99": None}
    rows = {name: dict(row) for name in ("own", *PRESETS)}
    rows["own"]["all_evaluations"] = 12.0
    return {"format": 1, "scenes": {"hello": {"size": [32, 18], "time": 0.0, "params": {"size": 1}, "rows": rows}}}


def a_measurement() -> Any:
    point = {"name": "base", "preset": None, "quality": dataclasses.asdict(Quality()), "frames": 1, "scale": 1}
    point |= {"variations": {}, "errors": {"missed": 0, "false": 0, "pixels_p99": 0.1}, "milliseconds": {"median": 2.0}}
    return {"size": [64, 36], "points": [point, {**point, "preset": "fine", "milliseconds": {"median": 9.0}}]}


def state() -> Any:
    return opened_state(Path("scene.py"), rm.Scene(rm.sphere(rm.Param("size", 1.0, 0.5, 2.0))), {}, 1.5)


def restored(file: Path) -> None:
    settings = read_json("--settings", file, SAVED_SETTINGS)
    with reading("--settings", file, SAVED_SETTINGS):
        state().restore(settings)


def measured(file: Path) -> None:
    found = read_json("--cost", file, "")
    with reading("--cost", file, ""):
        measured_stops(found)


def as_texture(file: Path) -> None:
    for reader in (rm.triplanar, rm.ImageSky):
        reader(file)


def as_mask(file: Path) -> None:
    for reader in (rm.triplanar, rm.image):
        reader(file, **({"resolution": 16} if reader is rm.image else {}))


def as_mesh(file: Path) -> None:
    mesh(file, resolution=8, cache=file.parent / "none")
    for kept in (file.parent / "none").glob("*"):
        kept.unlink()


PLACES = np.random.default_rng(2).uniform(-2.0, 2.0, (40, 3))


def built_cells(file: Path) -> Any:
    prices = dataclasses.replace(STANDARD, kept_objects=10, kept_seconds=0.0)
    (rows,) = gather(rm.union(*[rm.sphere(0.2).translate(p) for p in PLACES]), "data", 0.0).rows
    made = kept_cells.build(rows, 0.1, prices)
    return [getattr(made, f.name) for f in dataclasses.fields(made)]


def cached_mesh(file: Path) -> Any:
    ball = file.parent / "a.stl"
    if not ball.exists():
        trimesh.creation.icosphere(1).export(ball)
    return [mesh(ball, resolution=8, cache=file.parent).distance(PLACES)]


def known_truth(file: Path) -> Any:
    from raymarch.cost.reference import reference

    found = reference(rm.Scene(rm.sphere()), (8, 6), samples=1)
    return [getattr(found, f.name) for f in dataclasses.fields(found)]


def cached(use: Callable[[Path], Any], pattern: str) -> tuple[Make, Use]:
    """A file of the cache that `use` reads; mutated, the result must not change."""
    true: list[Any] = []

    def make(folder: Path) -> Path:
        os.environ["RAYMARCH_CACHE"] = str(folder)
        true[:] = use(folder / "x")
        (file,) = folder.glob(pattern)
        return file

    def check(file: Path) -> None:
        root = Path(os.environ["RAYMARCH_CACHE"])
        for found, known in zip(use(root / "x"), true, strict=True):
            assert np.array_equal(found, known, equal_nan=np.asarray(known).dtype.kind == "f"), "another result"

    return make, check


def arrays(name: str, write: Callable[[Path, Any], object]) -> Make:
    """Writes the values of a ball on a lattice of 5 points an axis, as flat rows where the format has no third axis."""

    def make(folder: Path) -> Path:
        x, y, z = np.meshgrid(*3 * [np.linspace(-1.0, 1.0, 5)], indexing="ij")
        write(folder / name, np.sqrt(x * x + y * y + z * z) - 0.7)
        return folder / name

    return make


def by_scene(values: str) -> Use:
    """A scene file beside the data that reads them with NumPy; its name begins with theirs. values : an expression."""

    def use(file: Path) -> None:
        imports = (
            "import io, numpy as np, raymarch as rm\nfrom pathlib import Path"  # NumPy leaves a broken archive open
        )
        lines = (imports, f"file = {file.name!r}", f"values = {values}")
        scene = file.with_name(f"{file.name}.py")
        solids = "rm.grid(values, (2, 2, 2)) | rm.instances(rm.sphere(), np.asarray(values)[0][:, :3])"
        scene.write_text("\n".join((*lines, f"scene = {solids}\n")))
        with contextlib.chdir(file.parent):
            load(scene)

    return use


def scene_text(folder: Path) -> Path:
    lines = (
        "import raymarch as rm",
        "ball = rm.sphere(rm.Param('size', 1.0, 0.5, 2.0)).translate((1, 0, 0))",
        "solid = rm.union(ball, rm.box((1, 2, 1)).round(0.1), k=0.2).material(rm.Material((0.8, 0.2, 0.1)))",
        "scene = rm.Scene(solid, camera=rm.Camera((0, 1, 5), (0, 0, 0)), lights=[rm.Sun()])",
    )
    (folder / "a.py").write_text("\n".join(lines))
    return folder / "a.py"


def line(folder: Path) -> Path:
    ends = "10\n0\n20\n0\n11\n1\n21\n1\n"
    (folder / "a.dxf").write_text(f"0\nSECTION\n2\nENTITIES\n0\nLINE\n{ends}0\nENDSEC\n0\nEOF\n")
    return folder / "a.dxf"


def manufactured(folder: Path) -> Path:
    """A model of 3D Manufacturing Format, which is a zip archive: read where networkx and lxml are installed."""
    points = "".join(f'<vertex x="{x}" y="{y}" z="{z}"/>' for x, y, z in ((0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)))
    faces = ((0, 2, 1), (0, 1, 3), (1, 2, 3), (0, 3, 2))
    triangles = "".join(f'<triangle v1="{a}" v2="{b}" v3="{c}"/>' for a, b, c in faces)
    core = "http://schemas.microsoft.com/3dmanufacturing/core/2015/02"
    mesh = f"<mesh><vertices>{points}</vertices><triangles>{triangles}</triangles></mesh>"
    model = f'<resources><object id="1" type="model">{mesh}</object></resources><build><item objectid="1"/></build>'
    with zipfile.ZipFile(folder / "a.3mf", "w") as archive:
        text = f'<?xml version="1.0"?><model unit="millimeter" xmlns="{core}">{model}</model>'
        archive.writestr("3D/3dmodel.model", text)
    return folder / "a.3mf"


KINDS: dict[str, tuple[Make, Use]] = {
    "png": (picture("a.png"), as_texture),
    "png with alpha": (picture("b.png", "RGBA"), as_mask),
    "png of 16 bits": (picture("c.png", "I;16"), lambda file: rm.heightmap(file)),
    "jpeg": (picture("a.jpg"), as_texture),
    "gif": (picture("a.gif"), as_mask),
    "tiff": (picture("a.tif", compression="tiff_lzw"), as_texture),
    "bmp": (picture("a.bmp"), lambda file: rm.sphere(1).displace_by_image(file)),
    "webp": (picture("a.webp"), as_texture),
    "hdr": (hdr, as_texture),
    "exr": (exr, as_texture),
    "stl": (solid("a.stl"), as_mesh),
    "stl ascii": (solid("b.stl", file_type="stl_ascii"), as_mesh),
    "obj": (obj_with_material, as_mesh),
    "ply": (solid("a.ply"), as_mesh),
    "ply ascii": (solid("b.ply", encoding="ascii"), as_mesh),
    "off": (solid("a.off"), as_mesh),
    "glb": (solid("a.glb"), as_mesh),
    "gltf": (solid("model.gltf"), as_mesh),
    "zip": (zipped, as_mesh),
    "3mf": (manufactured, as_mesh),
    "xyz": (arrays("a.xyz", lambda file, a: np.savetxt(file, a[0][:, :3])), as_mesh),
    "dxf": (line, as_mesh),
    "npy": (arrays("a.npy", np.save), by_scene("np.load(file)")),
    "npz": (
        arrays("a.npz", lambda file, a: np.savez(file, a=a)),
        by_scene("np.load(io.BytesIO(Path(file).read_bytes()))['a']"),
    ),
    "csv": (
        arrays("a.csv", lambda file, a: np.savetxt(file, a.reshape(25, 5), delimiter=",")),
        by_scene("np.loadtxt(file, delimiter=',').reshape(5, 5, 5)"),
    ),
    "py": (scene_text, load),
    "pgm": (picture("a.pgm", "L"), as_mask),
    "ppm": (picture("a.ppm"), as_texture),
    "tga": (picture("a.tga"), as_texture),
    "jp2": (picture("a.jp2"), as_texture),
    "pcx": (picture("a.pcx"), as_texture),
    "sgi": (picture("a.sgi"), as_texture),
    "ico": (picture("a.ico"), as_mask),
    "dds": (picture("a.dds"), as_texture),
    "ttf": (font, lambda file: rm.text("Ab", font=file, resolution=8)),
    "json of a baseline": (stored("a.json", a_baseline), baseline.read),
    "json of costs": (stored("b.json", a_measurement), measured),
    "json of settings": (stored("c.json", lambda: state().settings()), restored),
    "cells in the cache": cached(built_cells, "cells/*.npz"),
    "mesh in the cache": cached(cached_mesh, "mesh-*.npz"),
    "reference in the cache": cached(known_truth, "truth/*.npz"),
}

EXTREMES = (b"\xff\xff\xff\xff", b"\x7f\xff\xff\xff", b"\xff\xff\xff\x7f", b"\0\0\0\0", b"\0\0\xf0\x7f", b"\x80\0\0\0")
WORDS = (b"-1", b"9999", b"1e999", b"nan", b"99999999999999999999", b"1e300", b"null", b"[]", b"0", b'"a"', b"true")


def mutated(content: bytes, chance: random.Random) -> bytes:
    """A file with one to three faults: bytes, numbers, words or parts of it replaced, cut, repeated or exchanged."""
    made = bytearray(content)
    for _ in range(chance.choice((1, 1, 1, 2, 3))):
        # Half of the faults lie in the header.
        at = chance.randrange(max(1, min(len(made), chance.choice((128, len(made))))))
        end = min(len(made), at + chance.choice((1, 4, 16, 256)))
        match chance.randrange(8):
            case 0 if made:
                made[min(at, len(made) - 1)] = chance.randrange(256)
            case 1:
                made[at : at + 4] = chance.choice(EXTREMES)
            case 2:
                del made[at:]
            case 3:
                del made[at:end]
            case 4:
                made[at:at] = made[at:end] * chance.choice((1, 1, 50))
            case 5:
                made[at:at] = chance.choice((b"[", b"\n", b" ", b"\0")) * chance.choice((1, 1, 30_000))
            case _:
                digits = [i for i in range(at, min(len(made), at + 400)) if chr(made[i]).isdigit()]
                if digits:
                    i = chance.choice(digits)
                    j = i + 1
                    while j < len(made) and chr(made[j]) in "0123456789.eE+-":
                        j += 1
                    made[i:j] = chance.choice(WORDS)
                else:
                    made[at : at + 8] = chance.randbytes(8)
    return bytes(made)


def fault_of(use: Use, file: Path) -> str | None:
    """What is wrong about how a file is read; None if nothing is."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            use(file)
    except RaymarchError as fault:
        said = str(fault)
        return None if file.name in said and "\n" not in said else f"message: {said[:300]}"
    except Exception as fault:
        return f"{type(fault).__name__}: {str(fault)[:300]}"
    return None


def tried(kind: str, folder: Path, numbers: Iterator[int], seed: int) -> Iterator[tuple[int, str | None]]:
    """The faults of some mutations of a kind of file."""
    make, use = KINDS[kind]
    file = make(folder)
    content, beside = file.read_bytes(), {other: other.read_bytes() for other in file.parent.glob("*.bin")}
    cases = [(file, content), *beside.items()]
    if (whole := fault_of(use, file)) is not None:
        raise AssertionError(f"{kind} as written: {whole}")
    for number in numbers:
        chance = random.Random(f"{seed} {kind} {number}")
        changed, before = chance.choice(cases)
        changed.write_bytes(mutated(before, chance))
        yield number, fault_of(use, file)
        changed.write_bytes(before)


def _peak() -> int:
    status = Path("/proc/self/status").read_text()
    return 1024 * int(status.partition("VmHWM:")[2].split()[0])


def _child(kind: str, count: int, seed: int, first: int, out: int) -> None:
    """Judge mutations, and write a line for each: its number before, and its fault after."""
    resource.setrlimit(resource.RLIMIT_AS, (16 << 30, 16 << 30))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    signal.signal(signal.SIGPROF, signal.SIG_DFL)
    with tempfile.TemporaryDirectory() as folder, os.fdopen(out, "w", buffering=1) as lines:
        os.dup2(os.open(os.devnull, os.O_WRONLY), 2)

        def numbers() -> Iterator[int]:
            for number in range(first, count):
                lines.write(json.dumps([number, "begins", 0]) + "\n")
                Path("/proc/self/clear_refs").write_text("5")  # the peak is that of now
                signal.setitimer(signal.ITIMER_PROF, SECONDS)
                yield number

        before = _peak()
        for number, fault in tried(kind, Path(folder), numbers(), seed):
            signal.setitimer(signal.ITIMER_PROF, 0)
            lines.write(json.dumps([number, fault, max(0, _peak() - before)]) + "\n")


def judged(kind: str, count: int, seed: int) -> tuple[dict[int, str], int]:
    """The faults of a kind by number, and the largest peak of memory, in bytes. A process that dies is followed by one
    that goes on with the next mutation."""
    faults: dict[int, str] = {}
    first, most = 0, 0
    while first < count:
        reader, writer = os.pipe()
        child = os.fork()
        if not child:
            os.close(reader)
            try:
                _child(kind, count, seed, first, writer)
            except BaseException as fault:
                print(f"{kind}: {fault!r}", file=sys.__stdout__, flush=True)
                os._exit(1)
            os._exit(0)
        os.close(writer)
        number = first - 1
        with os.fdopen(reader) as lines:
            for line in lines:
                number, fault, peak = json.loads(line)
                most = max(most, peak)
                if fault not in (None, "begins"):
                    faults[number] = fault
                elif peak > BYTES:
                    faults[number] = f"{peak / 2**20:,.0f} MiB"
        ended = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
        if ended > 0:
            raise SystemExit(f"{kind}: the driver failed")
        if ended < 0:
            faults[number] = "hangs" if -ended == signal.SIGPROF else f"dies by {signal.Signals(-ended).name}"
        first = number + 1
    return faults, most


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=300)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--kinds", nargs="*", choices=KINDS, default=list(KINDS))
    given = parser.parse_args()
    total = 0
    for kind in given.kinds:
        faults, most = judged(kind, given.count, given.seed)
        print(f"{kind}: {len(faults)} of {given.count} at fault, at most {most / 2**20:,.0f} MiB", flush=True)
        for number, fault in sorted(faults.items()):
            print(f"    {number}: {fault}", flush=True)
        total += len(faults)
    print(f"{total} of {given.count * len(given.kinds)} mutations at fault")
    sys.exit(total > 0)


if __name__ == "__main__":
    main()
