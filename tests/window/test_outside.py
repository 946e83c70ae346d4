"""Values from outside: OSC messages as real UDP packets, and MIDI controllers."""

from __future__ import annotations

import socket
import struct
import sys
import threading
from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

import pytest

from raymarch.errors import SceneError
from raymarch.window.model import Model
from raymarch.window.outside import Outside, listening, slot_of
from tests.support.window_driver import PATIENCE
from tests.window.test_commands import model_of

SCENE = """import raymarch as rm
radius = rm.Param("radius", 1.0, 0.5, 2.0)
tint = rm.Param("ball tint", (0.75, 0.2, 0.08), 0, 1)
free = rm.Param("free", 0.0)
scene = rm.Scene(rm.sphere(radius).translate((free, 0, 0)).material(rm.Material(color=tint)))
"""


@pytest.fixture
def outside() -> Iterator[Outside]:
    made = Outside()
    yield made
    made.close()


@pytest.fixture
def model() -> Model:
    return model_of(SCENE)


def packet(address: str, *values: Any) -> bytes:
    """An OSC message, by its specification: strings end with zeros up to a multiple of four; numbers are big-endian."""

    def text(word: str) -> bytes:
        return word.encode() + b"\0" * (4 - len(word.encode()) % 4)

    numbers = b"".join(text(v) if isinstance(v, str) else struct.pack(">f", v) for v in values)
    return text(address) + text("," + "".join("s" if isinstance(v, str) else "f" for v in values)) + numbers


def test_osc_messages_set_parameters(outside: Outside, model: Model) -> None:
    """Real UDP packets; values outside the range are clamped, and wrong ones are named."""
    pytest.importorskip("pythonosc")
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    heard = threading.Semaphore(0)
    outside.wake = heard.release
    outside.osc(str(port))

    def send(*packets: bytes) -> None:
        for data in packets:
            sender.sendto(data, ("127.0.0.1", port))
            assert heard.acquire(timeout=PATIENCE)
        outside.take(model)

    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        send(packet("/radius", 1.25), packet("/ball_tint", 0.5, 0.25, 7.0))
        assert model.state.value("radius") == 1.25 and model.state.value("ball tint") == (0.5, 0.25, 1.0)
        send(packet("/raymarch/radius", 99.0), packet("/ball_tint/r", 0.1), packet("/time", 2.5))
        assert model.state.value("radius") == 2.0 and model.state.value("ball tint") == (0.1, 0.25, 1.0)
        assert model.state.timeline.time == 2.5 and not model.undone
        sender.sendto(b"no message", ("127.0.0.1", port))
        send(packet("/nothing", 1.0))
        assert "no such parameter (/radius, /ball_tint, /free)" in model.notice_text
        send(packet("/radius", "wide"))
        assert model.state.value("radius") == 2.0 and "a number >= 0.5 and <= 2" in model.notice_text
        send(packet("/radius", float("nan")))
        assert model.state.value("radius") == 2.0
        with pytest.raises(SceneError, match="a free port"):
            Outside().osc(str(port))
    outside.close()
    again = listening(str(port), None)  # it is free
    again.close()


def test_controllers_take_parameters_in_order_or_the_selected_one(outside: Outside, model: Model) -> None:
    """From the least to the greatest value; a parameter without a range has no controller."""

    def turn(number: int, value: int) -> None:
        outside._heard(SimpleNamespace(type="control_change", channel=0, control=number, value=value))
        outside.take(model)

    turn(21, 127)
    turn(22, 0)
    assert model.state.value("radius") == 2.0 and model.state.value("ball tint") == (0.0, 0.2, 0.08)
    turn(21, 0)
    assert model.state.value("radius") == 0.5
    model.state.selected = "radius"
    turn(74, 127)
    assert model.state.value("radius") == 2.0 and model.notice_text == "MIDI 74: radius"
    model.state.selected = None
    for number in (21, 30, 31):
        turn(number, 127)
    assert model.state.value("ball tint") == (0.0, 1.0, 1.0) and "every parameter" in model.notice_text
    outside._heard(SimpleNamespace(type="note_on"))


def test_a_midi_port_of_a_system(outside: Outside, model: Model, monkeypatch: pytest.MonkeyPatch) -> None:
    """The port whose name contains the given one. What the library opens is a stand-in: machines lack MIDI."""
    mido = pytest.importorskip("mido")
    opened: list[dict[str, Any]] = []
    monkeypatch.setattr(mido, "get_input_names", lambda: ["Through 14:0", "nanoKONTROL2 20:0"])
    monkeypatch.setattr(
        mido, "open_input", lambda **given: opened.append(given) or SimpleNamespace(close=lambda: opened.clear())
    )
    outside.midi("kontrol")
    opened[0]["callback"](mido.Message("control_change", channel=2, control=7, value=127))
    outside.take(model)
    assert opened[0]["name"] == "nanoKONTROL2 20:0" and model.state.value("radius") == 2.0
    with pytest.raises(SceneError, match="Through 14:0, nanoKONTROL2 20:0, virtual"):
        outside.midi("launchpad")
    outside.close()
    assert not opened


def test_addresses(model: Model) -> None:
    specs = model.state.specs
    assert slot_of(specs, "/ball_tint/2") == slot_of(specs, "/ball_tint/z") == ("ball tint", 2)
    assert slot_of(specs, "/ball_tint/a") is slot_of(specs, "/radius/x") is slot_of(specs, "/") is None


@pytest.mark.parametrize(("option", "value", "package"), [("osc", "9000", "pythonosc"), ("midi", "any", "mido")])
def test_without_the_extra_it_says_what_to_install(option, value, package, monkeypatch) -> None:
    monkeypatch.setitem(sys.modules, package, None)
    with pytest.raises(
        SceneError, match=rf"--{option} needs the package {package} .*pip install python-osc mido python-rtmidi"
    ):
        listening(**{"osc": None, "midi": None, option: value})


@pytest.mark.parametrize("place", ["", "0", "70000", "port", "host:", ":"])
def test_a_wrong_port(place: str) -> None:
    with pytest.raises(SceneError, match="a port, 1 to 65535"):
        listening(place, None)
