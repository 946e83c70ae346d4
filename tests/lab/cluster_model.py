"""A model of the throughput of a film on 1 to 10,000 workers, by simulation of its queues.

A task goes through three servers: the scheduler, which serves one task at a time; a worker; and the client, which
receives one result at a time, writes its files and submits the next task. `AHEAD` tasks a worker are on their way.
Each number below is measured by `python -m tests.lab.cluster model`, but for the bandwidth.
"""

from __future__ import annotations

import heapq
from dataclasses import dataclass

from raymarch.cluster.submit import AHEAD


@dataclass(frozen=True)
class Costs:
    """Seconds, unless it says otherwise.

    Attributes
    ----------
    scheduler : of the scheduler for a task. client : of the client for a task, and `picture` for each picture of it.
    worker : of a worker for a task besides drawing. size : bytes of a picture. bandwidth : bytes a second into the
    client. scene : to send the scene to a worker, load and compile it.
    """

    scheduler: float
    client: float
    picture: float
    worker: float
    size: float
    bandwidth: float = 1e9
    scene: float = 3.0


def limits(costs: Costs, workers: int, frame: float, batch: int) -> dict[str, float]:
    """Frames a second that each server alone allows."""
    return {
        "workers": workers * batch / (frame * batch + costs.worker),
        "scheduler": batch / costs.scheduler,
        "client": batch / (costs.client + batch * (costs.picture + costs.size / costs.bandwidth)),
    }


def simulated(costs: Costs, workers: int, frame: float, batch: int = 1, tasks: int | None = None) -> float:
    """Frames a second of a film. frame : seconds to draw one."""
    tasks = tasks or max(400, 5 * workers)
    times = {"scheduler": costs.scheduler, "worker": frame * batch + costs.worker}
    times["client"] = costs.client + batch * (costs.picture + costs.size / costs.bandwidth)
    free = {"scheduler": 0.0, "client": 0.0}
    idle = [costs.scene] * workers  # the times at which workers are free
    order = ("scheduler", "worker", "client")
    ahead = min(AHEAD * workers, tasks)
    events = [(0.0, k, 0) for k in range(ahead)]  # time, number, stage
    begun, done, first, ends = ahead, 0, 0.0, 0.0
    while events:
        now, number, stage = heapq.heappop(events)
        if stage == len(order):
            done, ends = done + 1, now
            first = now if done == tasks // 4 else first  # the start is left out
            if begun < tasks:
                heapq.heappush(events, (now, begun, 0))
                begun += 1
            continue
        name = order[stage]
        if name == "worker":
            start = max(now, heapq.heappop(idle))
            heapq.heappush(idle, start + times[name])
        else:
            start = max(now, free[name])
            free[name] = start + times[name]
        heapq.heappush(events, (start + times[name], number, stage + 1))
    return batch * (done - tasks // 4) / (ends - first)


def turning_point(costs: Costs, frame: float, batch: int) -> tuple[float, str]:
    """The number of workers beyond which another server is the limit, and which."""
    others = limits(costs, 1, frame, batch)
    one = others.pop("workers")
    name = min(others, key=lambda key: others[key])
    return others[name] / one, name
