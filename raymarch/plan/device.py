"""Classes of devices, and what a plan chooses for each."""

from __future__ import annotations

import os
from dataclasses import asdict, dataclass, replace
from typing import Any, Final

from raymarch.errors import PlanError
from raymarch.prices import STANDARD, Prices


@dataclass(frozen=True, slots=True)
class DeviceClass:
    """Devices for which a plan chooses alike.

    name : "software" or "hardware". reason : what they have in common.
    branches : True if functions that choose between costly values find the choice first, then evaluate one value.
    arrays : True if an array with a computed index is as fast as other variables: else it is kept in memory.
    rolls : True if long folds over constants are loops in the text: it compiles faster. Loops of software drivers end
        after 65,535 turns in all.
    prices : what it takes for the parts of each choice. measured : where and when they were measured on a driver; ""
        for those of the class.
    """

    name: str
    reason: str
    branches: bool
    arrays: bool
    rolls: bool
    prices: Prices = STANDARD
    measured: str = ""


SOFTWARE: Final = DeviceClass(
    "software", "the CPU draws, and executes both sides of a branch", branches=False, arrays=True, rolls=False
)
HARDWARE: Final = DeviceClass(
    "hardware", "a GPU skips the side of a branch that is not taken", branches=True, arrays=False, rolls=True
)

WRITTEN_OUT: Final = replace(HARDWARE, rolls=False)
"""The text for hardware on a software driver."""

CLASSES: Final = {each.name: each for each in (SOFTWARE, HARDWARE)}

FORCED: Final = "RAYMARCH_DEVICE_CLASS"
"""The variable of the environment that decides the class, in place of the driver."""


def device_class(is_software: bool = True) -> DeviceClass:
    """The class of a driver, or the one that the environment names. is_software : True if the CPU draws."""
    forced = os.environ.get(FORCED, "")
    found = of_name(forced, FORCED) if forced else SOFTWARE if is_software else HARDWARE
    return WRITTEN_OUT if is_software and found is HARDWARE else found


def of_name(name: str, what: str = "--device-class") -> DeviceClass:
    """The class of a name; PlanError if there is none. what : says where the name is from."""
    if name not in CLASSES:
        raise PlanError(f"{what} {name}", legal=", ".join(CLASSES))
    return CLASSES[name]


def as_plain(device: DeviceClass) -> dict[str, Any]:
    """A class and its prices as JSON types; see `of_plain`."""
    return {"class": device.name, "rolls": device.rolls, "prices": asdict(device.prices), "measured": device.measured}


def of_plain(given: dict[str, Any] | None) -> DeviceClass:
    """The class that `as_plain` was given. None : software."""
    if given is None:
        return SOFTWARE
    prices = Prices(**given["prices"])
    return replace(CLASSES[given["class"]], rolls=given["rolls"], prices=prices, measured=given["measured"])
