"""Values from outside: OSC messages and MIDI controllers set parameters. Needs the extra `live`."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack
from dataclasses import dataclass, field
from typing import Any, TypeAlias

import numpy as np

from raymarch.errors import SceneError
from raymarch.files import import_optional, install
from raymarch.scene.parameter import Spec
from raymarch.window.model import Model

EXTRA = "live"
"""The extra with the libraries."""

VIRTUAL = "virtual"
"""The name for `midi` of a port that other programs connect to."""

COMPONENTS = {letter: i for letters in ("0123", "xyzw", "rgba") for i, letter in enumerate(letters)}
"""The last part of an address of one number of a vector."""

Slot: TypeAlias = tuple[str, int | None]
"""A parameter, and the index of one of its numbers; None is all."""

Controller: TypeAlias = tuple[int, int]
"""Channel and number of a MIDI controller."""


@dataclass(slots=True)
class Outside:
    """Listens in threads of its own. The latest value of each address or controller waits for `take`.

    wake : called when a value has come. controllers : the parameters of the MIDI controllers that were moved.
    """

    wake: Callable[[], None] = lambda: None
    controllers: dict[Controller, Slot] = field(default_factory=dict)
    _said: set[str] = field(default_factory=set)
    _waiting: dict[Any, tuple[Any, ...]] = field(default_factory=dict)
    _lock: Any = field(default_factory=threading.Lock)
    _open: ExitStack = field(default_factory=ExitStack)

    def osc(self, place: str) -> None:
        """Listen for OSC messages by UDP on a port, "9000", of this machine, or of an address, "0.0.0.0:9000".

        Raises SceneError for a port that cannot be used, or without the extra.
        """
        host, _, port = place.rpartition(":")
        if not port.isdigit() or not 0 < int(port) < 65536:
            raise SceneError(f"--osc {place}", legal="a port, 1 to 65535, or ADDRESS:PORT")
        import_optional("--osc", "pythonosc", EXTRA)
        server = import_optional("--osc", "pythonosc.osc_server", EXTRA)
        table = import_optional("--osc", "pythonosc.dispatcher", EXTRA).Dispatcher()
        table.set_default_handler(lambda address, *values: self.put(address, values))
        try:
            made = server.BlockingOSCUDPServer((host or "127.0.0.1", int(port)), table)
        except OSError as fault:
            raise SceneError(f"--osc {place}: {fault.strerror}", legal="a free port of this machine") from None
        self._open.callback(made.server_close)
        self._open.callback(made.shutdown)
        threading.Thread(target=made.serve_forever, args=(0.1,), name="osc", daemon=True).start()

    def midi(self, name: str) -> None:
        """Listen to the controllers of a MIDI input: the first whose name contains `name`, or a virtual port.

        Raises SceneError for an input that is not there, or without the extra.
        """
        mido = import_optional("--midi", "mido", EXTRA)
        try:
            names = mido.get_input_names()
            found = next((n for n in names if name.lower() in n.lower()), None)
            if found is None and name != VIRTUAL:
                raise SceneError(f"--midi {name}", legal=", ".join([*names, VIRTUAL]))
            own = {"name": "raymarch", "virtual": True} if name == VIRTUAL else {"name": found}
            port = mido.open_input(**own, callback=self._heard)
        except ImportError as fault:
            raise SceneError(f"--midi needs the package {fault.name}", legal=install(EXTRA)) from None
        except (OSError, NotImplementedError, RuntimeError) as fault:
            raise SceneError(f"--midi {name}: {fault}", legal="a system with MIDI") from None
        self._open.callback(port.close)

    def _heard(self, message: Any) -> None:
        if message.type == "control_change":
            self.put((message.channel, message.control), (message.value / 127.0,))

    def put(self, address: str | Controller, values: tuple[Any, ...]) -> None:
        """Note the values that came for an address or controller. May be called in any thread."""
        with self._lock:
            self._waiting[address] = values
        self.wake()

    def take(self, model: Model) -> None:
        """Set what came since the last call."""
        with self._lock:
            waiting, self._waiting = self._waiting, {}
        for address, values in waiting.items():
            if isinstance(address, str):
                self._message(model, address, values)
            else:
                self._controller(model, address, values[0])

    def _message(self, model: Model, address: str, values: tuple[Any, ...]) -> None:
        numbers = [_shortest(float(v)) for v in values if isinstance(v, int | float)]
        slot = slot_of(model.state.specs, address)
        if slot is None and address.strip("/") == "time" and len(numbers) == 1 and np.isfinite(numbers[0]):
            model.state.timeline = model.state.timeline.scrub(numbers[0])
        elif slot is None:
            names = ", ".join(address_of(name) for name in model.state.specs) or "none in this scene"
            self._say(model, f"OSC {address}: no such parameter ({names})")
        elif len(numbers) != len(values) or not set_slot(model, slot, numbers):
            self._say(model, f"OSC {address} {values}: {model.state.specs[slot[0]].legal}")

    def _controller(self, model: Model, controller: Controller, share: float) -> None:
        """Set the parameter of a controller: the one that is selected, or the next that has no controller."""
        specs, selected = model.state.specs, model.state.selected
        slots = list(slots_of(specs))
        known = self.controllers.get(controller)
        taken = set(self.controllers.values())
        free = [slot for slot in slots if slot not in taken]
        chosen = [slot for slot in slots if slot[0] == selected]
        if chosen and (known is None or known[0] != selected):
            slot = next((slot for slot in chosen if slot in free), chosen[0])
        elif known in slots:
            slot = known
        elif free:
            slot = free[0]
        else:
            self._say(model, "MIDI: every parameter with a range has a controller (N selects another)")
            return
        if slot != known:
            self.controllers = {c: s for c, s in self.controllers.items() if s != slot} | {controller: slot}
            model.notice(f"MIDI {controller[1]}: {slot[0]}{'' if slot[1] is None else f' {slot[1] + 1}'}")
        low, high = (float(np.ravel(end)[(slot[1] or 0) % np.size(end)]) for end in specs[slot[0]].ends)
        set_slot(model, slot, [low + (high - low) * share])

    def _say(self, model: Model, text: str) -> None:
        """Show a notice, each text once."""
        if text not in self._said:
            self._said.add(text)
            model.notice(text)

    def close(self) -> None:
        """End the threads. Idempotent."""
        self._open.close()


def listening(osc: str | None, midi: str | None) -> Outside:
    """What listens to the OSC messages and the MIDI input of `raymarch view`."""
    made = Outside()
    try:
        if osc is not None:
            made.osc(osc)
        if midi is not None:
            made.midi(midi)
    except SceneError:
        made.close()
        raise
    return made


def _shortest(value: float) -> float:
    """The shortest decimal number that a float32 stands for: .1 in place of .100000001; others as they are."""
    narrow = np.float32(value)
    return float(str(narrow)) if float(narrow) == value else value


def address_of(name: str) -> str:
    """The OSC address of a parameter: spaces are underscores."""
    return f"/{name.replace(' ', '_')}"


def slot_of(specs: Mapping[str, Spec], address: str) -> Slot | None:
    """The parameter of an address such as "/radius", "/raymarch/radius", "/tint" or "/tint/r"; None for others."""
    names = {address_of(name): name for name in specs}
    path = address.removeprefix("/raymarch")
    if path in names:
        return names[path], None
    before, _, last = path.rpartition("/")
    name, index = names.get(before), COMPONENTS.get(last, 4)
    return (name, index) if name is not None and index < np.size(specs[name].value) > 1 else None


def slots_of(specs: Mapping[str, Spec]) -> Iterator[Slot]:
    """The numbers that have a range, in the order of the parameters."""
    for name, spec in specs.items():
        if np.all(np.isfinite(spec.ends[0])) and np.all(np.isfinite(spec.ends[1])):
            yield from ((name, i) for i in range(len(spec.value))) if isinstance(spec.value, tuple) else ((name, None),)


def set_slot(model: Model, slot: Slot, numbers: list[float]) -> bool:
    """Set a parameter or one of its numbers, clamped to its range. False if the values do not fit."""
    name, index = slot
    now = model.state.value(name)
    values = list(now) if isinstance(now, tuple) else [now]
    if index is not None and len(numbers) == 1:
        values[index] = numbers[0]
    elif index is None and len(numbers) == len(values):
        values = numbers
    else:
        return False
    try:
        model.state.set(name, tuple(values) if isinstance(now, tuple) else values[0])
    except SceneError:  # not a finite number
        return False
    model.say("param", name=name, value=model.state.value(name), outside=True)
    return True
