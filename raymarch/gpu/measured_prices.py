"""Prices that were measured on a driver, in the cache on disk: one file for each driver and version of the package.

`raymarch doctor --measure` writes it. A file that cannot be used is ignored with a warning: the class's prices hold.
"""

from __future__ import annotations

import hashlib
import json
import os
import tempfile
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import asdict, dataclass, fields, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import raymarch
from raymarch import cache
from raymarch.errors import RaymarchError, warn
from raymarch.files import read_json, written
from raymarch.plan.device import DeviceClass
from raymarch.prices import NEVER, SWITCH, Prices

FOLDER = "prices"
"""The folder in the cache."""

FACTOR = 1e4
"""Largest factor between a measured price and that of the class; one that is never paid has none."""

LEGAL = "a file that `raymarch doctor --measure` wrote; remove it, or measure again"


@dataclass(frozen=True, slots=True)
class Measured:
    """The prices of a driver.

    renderer, version : of the driver. package : version of raymarch. device : name of the class of devices.
    date : of the day, in ISO 8601. prices : those that were measured, by field of `Prices`.
    kept : why others are those of the class.
    """

    renderer: str
    version: str
    package: str
    device: str
    date: str
    prices: Mapping[str, float]
    kept: Mapping[str, str]

    @property
    def words(self) -> str:
        """Where and when they were measured."""
        return f"measured on {self.renderer}, {self.date}"


def file_of(renderer: str, version: str) -> Path | None:
    """The file of a driver's prices, whether it exists or not; None without a cache."""
    folder = cache.folder()
    if folder is None:
        return None
    key = hashlib.sha256("\0".join((renderer, version, raymarch.__version__)).encode()).hexdigest()
    return folder / FOLDER / f"{key[:24]}.json"


def are_used() -> bool:
    """False if the environment says that measured prices are ignored."""
    return os.environ.get(SWITCH, "").strip().lower() not in ("off", "0", "no", "false")


def are_kept() -> bool:
    """True if prices of some driver are in the cache, and used."""
    folder = cache.folder()
    with suppress(OSError):
        return are_used() and folder is not None and any((folder / FOLDER).glob("*.json"))
    return False


def known(renderer: str, version: str, device: DeviceClass) -> Measured | None:
    """The measured prices of a driver, if they can be used; warns of a file that cannot."""
    file = file_of(renderer, version)
    if file is None:
        return None
    try:
        found = file.stat()
    except OSError:
        return None
    read = _read(file, found.st_mtime_ns, renderer, version)
    return read if read is not None and read.device == device.name else None


@lru_cache(16)
def _read(file: Path, _changed: int, renderer: str, version: str) -> Measured | None:
    """The content of a file; None, and a warning, if it is broken or of another driver."""
    try:
        given = read_json("measured prices", file, LEGAL)
        made = Measured(**given)
        if (made.renderer, made.version, made.package) != (renderer, version, raymarch.__version__):
            raise ValueError("of another driver")
        standard = asdict(Prices())
        for name, value in made.prices.items():
            if value != NEVER and not 1.0 / FACTOR <= float(value) / standard[name] <= FACTOR:
                raise ValueError(name)
        return made
    except (RaymarchError, TypeError, ValueError, KeyError, AttributeError, OSError):
        warn(f"'{file}' is ignored, it does not hold prices of this driver ({LEGAL})")
        return None


def of_driver(renderer: str, version: str, device: DeviceClass) -> DeviceClass:
    """The class of a driver with its measured prices; the class alone if there are none, or they are not used."""
    found = known(renderer, version, device) if are_used() else None
    return device if found is None else with_prices(device, found)


def with_prices(device: DeviceClass, found: Measured) -> DeviceClass:
    """A class with measured prices."""
    return replace(device, prices=replaced(device.prices, found.prices), measured=found.words)


def replaced(prices: Prices, values: Mapping[str, float]) -> Prices:
    """Prices with some values, of the type of each field."""
    whole = {f.name for f in fields(Prices) if isinstance(getattr(prices, f.name), int)}
    given: dict[str, Any] = {name: round(v) if name in whole else float(v) for name, v in values.items()}
    return replace(prices, **given, by_operations=prices.by_operations or "look_up" in values)


def check_folder(error: type[RaymarchError]) -> Path:
    """The folder of the files, which is made. Raises `error` if there is no cache, or it cannot be written."""
    folder = cache.folder()
    if folder is None:
        raise error(f"measured prices: {cache.VARIABLE} is empty", legal="a folder for the cache")
    try:
        (folder / FOLDER).mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder / FOLDER):
            pass
    except OSError as fault:
        what = f"cannot write measured prices to '{folder / FOLDER}': {fault.strerror or fault}"
        raise error(what, legal=f"a writable folder, or another one in {cache.VARIABLE}") from None
    return folder / FOLDER


def keep(found: Measured, error: type[RaymarchError]) -> Path:
    """Write the prices of a driver. Raises `error` if there is no cache, or its folder cannot be written."""
    folder = check_folder(error)
    file = file_of(found.renderer, found.version) or folder
    with written(file, error) as partial:
        partial.write_text(json.dumps(asdict(found), indent=1) + "\n", encoding="utf-8")
    return file


def summary(renderer: str, version: str, device: DeviceClass) -> dict[str, Any] | None:
    """What is known of the prices of a driver: its file, whether it is used, and what it holds; None without a file."""
    found = known(renderer, version, device)
    return None if found is None else {"file": str(file_of(renderer, version)), "used": are_used(), **asdict(found)}
