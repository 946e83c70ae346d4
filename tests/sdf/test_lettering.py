"""Letters: those that a font lacks are refused by name; those that it has are drawn."""

from __future__ import annotations

from pathlib import Path

import matplotlib
import numpy as np
import pytest
from fontTools.ttLib import TTFont
from PIL import ImageFont

import raymarch as rm
from raymarch.errors import SceneError
from raymarch.sdf import lettering
from raymarch.sdf.lettering import _lacking

DEJAVU = Path(matplotlib.get_data_path()) / "fonts" / "ttf" / "DejaVuSans.ttf"
CHINESE = "\u6f22"
PLANE = np.random.default_rng(4).uniform(-0.6, 0.6, (500, 2))


@pytest.mark.parametrize("name", ["Pillow's own", "DejaVu Sans"])
def test_what_a_font_lacks_is_what_its_table_of_characters_lacks(name: str) -> None:
    font = ImageFont.load_default(32) if name == "Pillow's own" else ImageFont.truetype(DEJAVU, 32)
    if name == "Pillow's own":
        font.path.seek(0)
    known = TTFont(font.path).getBestCmap()
    letters = [chr(i) for i in (*range(0x20, 0x2000), *range(0x2000, 0xD800, 41), *range(0x1F000, 0x1F700))]
    lacking = set(_lacking("".join(letters), font))
    assert len(lacking) > 1000
    assert {letter for letter in letters if letter not in lacking} == {c for c in letters if ord(c) in known}


@pytest.fixture
def alone(monkeypatch: pytest.MonkeyPatch) -> None:
    """No other font is installed."""
    monkeypatch.setattr(lettering, "WIDE", ())


@pytest.mark.parametrize("letter", ["ä", "ß", "é", "ñ", "\u2013", "€", CHINESE, "\u200b", "\t"])
@pytest.mark.usefixtures("alone")
def test_a_letter_that_the_font_lacks_is_refused_by_name(letter: str) -> None:
    with pytest.raises(SceneError) as caught:
        rm.text(f"ab{letter}c{letter}")
    message = str(caught.value)
    assert message.count(repr(letter)) == 1
    assert "Aileron" in message and "font=" in message and "test_lettering.py:" in message


@pytest.mark.usefixtures("alone")
def test_all_that_lack_are_named_and_none_that_does_not() -> None:
    with pytest.raises(SceneError) as caught:
        rm.text("Größe: aäöo")
    message = str(caught.value)
    assert all(repr(letter) in message for letter in "öäß")
    assert not any(repr(letter) in message for letter in "Greo: a")


def test_ascii_is_there() -> None:
    rm.text("".join(map(chr, range(33, 80))), resolution=16)
    rm.text("".join(map(chr, range(80, 127))), resolution=16)
    rm.text("two words\nand two lines", resolution=16)


def test_an_installed_font_stands_in_for_pillows_own(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(lettering, "WIDE", (str(DEJAVU),))
    string = "Ünï Ωμέγα Привет"
    found, known = (rm.text(string, font, resolution=16) for font in (None, DEJAVU))
    np.testing.assert_array_equal(found.distance(PLANE), known.distance(PLANE))
    with pytest.raises(SceneError, match=rf"DejaVuSans\.ttf' lacks '{CHINESE}' of"):
        rm.text(string + CHINESE)


def test_a_font_is_found_by_its_family() -> None:
    by_family, by_file = (rm.text("Rg", font, resolution=16) for font in ("DejaVu Sans", DEJAVU))
    assert np.abs(by_family.distance(PLANE) - by_file.distance(PLANE)).max() < 0.05, "of some version"
    with pytest.raises(SceneError, match=r"no font 'Nowhere Sans'.*family"):
        rm.text("Rg", "Nowhere Sans")


def test_a_font_that_changes_under_its_name_is_read_again(tmp_path: Path) -> None:
    file = tmp_path / "own.ttf"
    made = []
    for font in (DEJAVU, DEJAVU.with_name("DejaVuSerif.ttf")):
        file.write_bytes(font.read_bytes())
        made.append((rm.text("R", file, resolution=16), rm.text("R", font, resolution=16)))
    assert made[0][0] == made[0][1] != made[1][0] == made[1][1]


def test_a_font_that_has_them_draws_them() -> None:
    """Its letters, not its sign for what is missing: two different letters are two different shapes."""
    one, other = (rm.text(letter, DEJAVU, resolution=24) for letter in "äß")
    assert np.abs(one.distance(PLANE) - other.distance(PLANE)).max() > 0.05
    with pytest.raises(SceneError, match="DejaVuSans"):
        rm.text(CHINESE, DEJAVU)


def test_a_letter_in_two_parts_is_the_letter_in_one() -> None:
    parts, whole = (rm.text(letter, DEJAVU, resolution=24) for letter in ("a\u0308", "\u00e4"))
    np.testing.assert_array_equal(parts.distance(PLANE), whole.distance(PLANE))


def test_a_line_may_end_as_in_a_file_of_windows() -> None:
    theirs, ours = (rm.text(f"a{end}b", DEJAVU, resolution=24) for end in ("\r\n", "\n"))
    np.testing.assert_array_equal(theirs.distance(PLANE), ours.distance(PLANE))


def test_half_a_character_is_none() -> None:
    with pytest.raises(SceneError, match="lacks"):
        rm.text("a\ud800")


def test_messages_name_the_function_that_was_called() -> None:
    drawn = rm.image(np.pad(np.ones((4, 4)), 2), resolution=16)
    for node, name in ((rm.text("a", resolution=16), "text"), (drawn, "image")):
        assert repr(node).startswith(f"<{name}: ")
        with pytest.raises(SceneError, match=f"Scene: {name} is flat"):
            rm.Scene(node)
