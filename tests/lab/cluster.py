"""Trials of films on a cluster of real processes: faults, scaling, large pictures, and a model of throughput.

python -m tests.lab.cluster faults           # a worker killed, one stopped, the scheduler killed, a film killed 5 times
python -m tests.lab.cluster scaling          # CPU seconds a frame with 1, 2 and 4 workers beside the plain command
python -m tests.lab.cluster large            # peak memory of a picture of 16384 x 16384 pixels, of 8192 x 8192 without
python -m tests.lab.cluster model            # throughput for 1 to 10,000 workers; writes docs/pictures/cluster.png
"""

from __future__ import annotations

import os
import random
import resource
import signal
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

import psutil

from tests.lab.cluster_model import Costs, simulated, turning_point
from tests.support.dask_processes import PYTHONPATH, Processes, wait_for, worker_of

SCENE = """import raymarch as rm
ball = rm.sphere(0.5).translate((rm.sin(rm.time), 0, 0)).material(rm.Material(color=(1, 0.4, 0.1)))
walls = rm.box((4, 2, 0.2)).twist(0.2).translate((0, 0, -1))
scene = rm.Scene(rm.union(ball, walls, k=0.2) | rm.plane(offset=-0.5), camera=rm.Camera((0, 1, 5), (0, 0, 0)))
"""
FRAMES = 48


def command(folder: Path, *words: str) -> subprocess.Popen[bytes]:
    """`raymarch render` of the scene in a folder, as a process."""
    environment = os.environ | {"PYTHONPATH": PYTHONPATH, "LP_NUM_THREADS": "1"}
    with (folder / "command.log").open("ab") as log:
        return subprocess.Popen(
            [sys.executable, "-m", "raymarch", "render", "scene.py", *words],
            cwd=folder,
            env=environment,
            stdout=log,
            stderr=log,
        )


def film(folder: Path, name: str, *words: str, frames: int = FRAMES, size: str = "320x180") -> subprocess.Popen[bytes]:
    return command(folder, "-o", name, "--frames", f"0:{frames}", "--fps", "24", "--size", size, *words)


def content(folder: Path, pattern: str) -> dict[str, bytes]:
    """The bytes of all files of a pattern, by the number in their names."""
    return {file.name.split("_")[1]: file.read_bytes() for file in folder.glob(pattern)}


def log_of(folder: Path) -> str:
    return (folder / "command.log").read_text(encoding="utf-8")


def faults(folder: Path) -> None:
    assert film(folder, "plain_%03d.png").wait() == 0
    plain = content(folder, "plain_*.png")
    assert len(plain) == FRAMES
    with Processes(folder) as dask:
        dask.start_worker()
        dask.start_worker()
        (folder / "command.log").unlink()
        running = film(folder, "a_%03d.png", "--cluster", dask.address)
        wait_for(lambda: len(content(folder, "a_*.png")) >= 12, 120, "12 frames")
        os.kill(worker_of(dask.nannies[0]), signal.SIGKILL)
        wait_for(lambda: len(content(folder, "a_*.png")) >= 24, 120, "24 frames")
        stopped = worker_of(dask.nannies[1])
        os.kill(stopped, signal.SIGSTOP)
        code = running.wait(timeout=300)
        text = log_of(folder)
        print("killed and stopped: exit", code, "same bytes", content(folder, "a_*.png") == plain)
        print("  drawn lines:", text.count("ms to draw"), " summary:", text[text.rindex("48 frames in") :].strip())
        (folder / "command.log").unlink()
        running = film(folder, "b_%03d.png", "--cluster", dask.address)
        wait_for(lambda: len(content(folder, "b_*.png")) >= 20, 120, "20 frames")
        dask.kill_scheduler()
        print("scheduler killed: exit", running.wait(timeout=120), log_of(folder).splitlines()[-1])
        kept = {file: file.stat().st_mtime_ns for file in folder.glob("b_*.png")}
        for nanny in dask.nannies:
            nanny.kill()
        (folder / "command.log").unlink()
        dask.start_scheduler()
        dask.start_worker()
        dask.start_worker()
        code = film(folder, "b_%03d.png", "--cluster", dask.address).wait(timeout=300)
        text = log_of(folder)
        same = content(folder, "b_*.png") == plain
        print(f"run again: exit {code}, same bytes {same}, {len(kept)} kept, {text.count('ms to draw')} drawn")
        print("  kept files untouched:", all(file.stat().st_mtime_ns == then for file, then in kept.items()))


def killed_films(folder: Path, seed: int = 1) -> None:
    """A film that is killed at random 5 times and resumed has the bytes of an undisturbed one."""
    chance = random.Random(seed)
    for name in ("film.mp4", "film.gif", "still_%03d.png"):
        assert film(folder, name).wait() == 0
        pattern = name.replace("%03d", "*")
        whole = {file.name: file.read_bytes() for file in folder.glob(pattern)}
        for file in folder.glob(pattern):
            file.unlink()
        kills = 0
        while kills < 5:
            running = film(folder, name)
            parts = f"{name}.frames/*.png" if "%" not in name else pattern
            before = len(list(folder.glob(parts)))
            stop = before + chance.randint(0, 8)
            wait_for(lambda: running.poll() is not None or len(list(folder.glob(parts))) >= stop, 120, "frames")  # noqa: B023
            time.sleep(chance.uniform(0, 0.1))
            running.kill()
            running.wait()
            kills += 1
        assert film(folder, name).wait() == 0
        found = {file.name: file.read_bytes() for file in folder.glob(pattern)}
        print(f"{name}: killed {kills} times, {len(found)} files, same bytes {found == whole}")


def large(folder: Path) -> None:
    """Peak resident memory of the client and of a worker for a large .tif, and of the plain command."""
    for size, words in (("16384x16384", ("--cluster", "local:1")), ("8192x8192", ())):
        running, peak, start = command(folder, "-o", "big.tif", "--size", size, *words), {}, time.perf_counter()
        while running.poll() is None:
            with suppress(psutil.Error):
                own = psutil.Process(running.pid)
                for process in (own, *own.children(recursive=True)):
                    with suppress(psutil.Error):
                        kind = "command" if process.pid == running.pid else "worker"
                        peak[kind] = max(peak.get(kind, 0), process.memory_info().rss)
            time.sleep(0.2)
        figures = ", ".join(f"{kind} {bytes / 2**20:.0f} MiB" for kind, bytes in peak.items())
        file = folder / "big.tif"
        print(f"{size} {' '.join(words)}: exit {running.returncode}, {time.perf_counter() - start:.0f} s, {figures}")
        print(f"  {file.stat().st_size / 2**20:.0f} MiB")
        file.unlink()


def usage(folder: Path, *words: str) -> tuple[float, float]:
    """CPU seconds of a command with all its processes, and its wall-clock seconds."""
    before, start = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    assert command(folder, *words).wait() == 0, log_of(folder)[-2000:]
    after, spent = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter() - start
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime, spent


CORES = len(os.sched_getaffinity(0))


def scaling(folder: Path, rounds: int = 2, few: int = 8, many: int = 56, sizes: Sequence[str] = ("320x180",)) -> None:
    """Seconds of one more frame: the difference of a long and a short film, so that the start does not count.

    The commands take turns, so that other load affects all of them. Medians over the rounds. Mesa has one thread in
    each process.
    """
    kinds: dict[str, tuple[str, ...]] = {"plain": (), "local:1, batch 1": ("--cluster", "local:1", "--batch", "1")}
    kinds |= {f"local:{n}": ("--cluster", f"local:{n}") for n in (1, 2, 4)}
    found: dict[str, list[tuple[float, float]]] = {kind: [] for kind in kinds}
    for size in sizes:
        for each in found.values():
            each.clear()
        for _ in range(rounds):
            for kind, words in kinds.items():
                ends = []
                for count in (few, many):
                    for file in folder.glob("s_*.png"):
                        file.unlink()
                    how = ("-o", "s_%03d.png", "--frames", f"0:{count}", "--fps", "24", "--size", size, *words)
                    ends.append(usage(folder, *how))
                found[kind].append(tuple((b - a) / (many - few) for a, b in zip(*ends, strict=True)))  # type: ignore
        print(f"{size}: seconds a frame, medians of {rounds} rounds")
        figures = {
            kind: [1e3 * statistics.median(v[k] for v in values) for k in (0, 1)] for kind, values in found.items()
        }
        for kind, (cpu, wall) in figures.items():
            line = f"  {kind:16}  {cpu:7.1f} ms CPU  {wall:7.1f} ms wall  {60e3 / wall:7.0f} frames a minute"
            if kind != "plain":  # all processes share the cores
                n = int(kind.removeprefix("local:").split(",")[0])
                line += f"; expected {60e3 / max(figures['plain'][1] / n, cpu / CORES):7.0f}"
            print(line)


def measured_costs(folder: Path) -> Costs:
    """The costs of a task, from the CPU seconds of client, scheduler and worker in films of tiny frames.

    Differences of a long and a short film, so that the start does not count; with batches of 1 and of 20, which
    separates the costs of a task from those of a picture.
    """
    few, many, batch = 20, 140, 20
    with Processes(folder) as dask:
        nanny = dask.start_worker()
        _film_cpu(folder, 1, "--cluster", dask.address)  # compiles
        address = ("--cluster", dask.address)

        def slope(*words: str) -> list[float]:
            ends = []
            for count in (few, many):
                before = _cpu(dask, nanny)
                client = _film_cpu(folder, count, *words)
                ends.append((client, *(b - a for a, b in zip(before, _cpu(dask, nanny), strict=True))))
            return [(b - a) / (many - few) for a, b in zip(*ends, strict=True)]

        one, twenty, plain = slope(*address, "--batch", "1"), slope(*address, "--batch", str(batch)), slope()[0]
    per_task = [max((a - b) / (1 - 1 / batch), 0.0) for a, b in zip(one, twenty, strict=True)]
    names = ("client", "scheduler", "worker")
    for what, values in (("batch 1", one), (f"batch {batch}", twenty)):
        print(f"CPU a frame, {what}:", ", ".join(f"{n} {1e3 * v:.1f} ms" for n, v in zip(names, values, strict=True)))
    print(f"the plain command: {1e3 * plain:.1f} ms a frame; overhead {1e3 * (sum(one) - plain):.1f} ms")
    return Costs(per_task[1], per_task[0], max(one[0] - per_task[0], 1e-4), per_task[2], 2e6)


def _film_cpu(folder: Path, count: int, *words: str) -> float:
    """CPU seconds of the command that draws a new film of tiny frames."""
    for file in folder.glob("m_*.png"):
        file.unlink()
    where = ("-o", "m_%03d.png", "--frames", f"0:{count}", "--fps", "24", "--size", "32x24")
    return usage(folder, *where, *words)[0]


def _cpu(dask: Processes, nanny: subprocess.Popen[bytes]) -> tuple[float, float]:
    """CPU seconds so far of the scheduler and of a nanny's worker."""
    assert dask.scheduler is not None
    found = [psutil.Process(pid).cpu_times() for pid in (dask.scheduler.pid, worker_of(nanny))]
    return found[0].user + found[0].system, found[1].user + found[1].system


def model(folder: Path) -> None:
    """Throughput by the number of workers, for three times of a frame and two sizes of a batch, as a figure."""
    from matplotlib.figure import Figure

    costs = measured_costs(folder)
    print(costs)
    drawn = Figure((6.4, 4.2), layout="constrained")
    axes = drawn.subplots()
    counts = [1, 2, 4, 10, 30, 100, 300, 1000, 3000, 10_000]
    for frame, color in ((0.1, "#1f6fc4"), (1.0, "#2a9d3a"), (60.0, "#b0207a")):
        for batch, line in ((1, "-"), (20, "--")):
            rates = [simulated(costs, n, frame, batch) for n in counts]
            limit, name = turning_point(costs, frame, batch)
            print(f"frame {frame:g} s, batch {batch}: {', '.join(f'{r:.3g}' for r in rates)} frames/s")
            print(f"  the {name} is the limit from {limit:.0f} workers on")
            axes.loglog(counts, rates, line, color=color, label=f"{frame:g} s a frame, batches of {batch}")
    axes.set_xlabel("workers")
    axes.set_ylabel("frames per second")
    axes.legend(fontsize=8)
    axes.grid(alpha=0.3)
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_formatter("{x:,.10g}")
    drawn.savefig(Path(__file__).parents[2] / "docs" / "pictures" / "cluster.png", dpi=110)


def main() -> None:
    what = sys.argv[1] if len(sys.argv) > 1 else ""
    with tempfile.TemporaryDirectory(prefix="raymarch-cluster-") as name:
        folder = Path(name)
        (folder / "scene.py").write_text(SCENE, encoding="utf-8")
        if what == "faults":
            faults(folder)
            killed_films(folder)
        elif what == "scaling":
            scaling(folder)
        elif what == "large":
            large(folder)
        elif what == "model":
            model(folder)
        else:
            print(__doc__)


if __name__ == "__main__":
    main()
