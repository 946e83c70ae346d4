"""The workers of a cluster: which versions and drivers they draw with, and whether these are the same."""

from __future__ import annotations

import platform
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import PIL

from raymarch.errors import ClusterError
from raymarch.export.stills import package
from raymarch.gpu.driver import Driver


@dataclass(frozen=True, slots=True)
class Machine:
    """All of a worker that a picture depends on.

    raymarch : version of the package and a hash of its files. libraries : versions of Python, NumPy and Pillow.
    driver : of OpenGL.
    """

    raymarch: str
    libraries: str
    driver: Driver

    def __str__(self) -> str:
        return f"{self.driver.renderer}, {self.driver.version}, {self.libraries}"


def libraries() -> str:
    """The versions of the libraries whose numbers and files a picture depends on."""
    python = ".".join(platform.python_version_tuple()[:2])
    return f"Python {python}, NumPy {np.__version__}, Pillow {PIL.__version__}"


def accepted(found: Mapping[str, Machine | str], mixed: bool) -> tuple[list[Machine], list[str]]:
    """The kinds of workers that may draw, the most frequent first, and sentences to print.

    found : of each worker by its address, the machine or the reason why it cannot draw. Raises ClusterError if no
    worker can draw, if a worker has another version of this package, or if drivers differ and `mixed` is False.
    """
    able = {address: machine for address, machine in found.items() if isinstance(machine, Machine)}
    unable = {address: str(reason) for address, reason in found.items() if address not in able}
    notes = [f"worker {address} is not used: {reason}" for address, reason in unable.items()]
    if not able:
        address, reason = next(iter(unable.items()))
        raise ClusterError(f"no worker can draw: {address}: {reason}", legal="raymarch doctor, on the worker")
    for address, machine in able.items():
        if machine.raymarch != package():
            raise ClusterError(
                f"worker {address} has raymarch {machine.raymarch}, this is {package()}", legal="the same version"
            )
    kinds: dict[Machine, list[str]] = {}
    for address, machine in able.items():
        kinds.setdefault(machine, []).append(address)
    order = sorted(kinds, key=lambda kind: (-len(kinds[kind]), str(kind)))
    if len(order) > 1:
        described = "; ".join(f"{_count(kinds[kind])}: {kind}" for kind in order)
        what = f"workers with {len(order)} kinds of drivers or libraries, which may differ in the last bit: {described}"
        if not mixed:
            raise ClusterError(what, legal="workers of one kind, or --mixed-drivers")
        notes.append(what)
    return order, notes


def _count(addresses: Sequence[str]) -> str:
    first = addresses[0]
    return f"{len(addresses)} workers such as {first}" if len(addresses) > 1 else first
