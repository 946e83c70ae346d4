"""What `help` says of a shape or operator: its parameters, its facts, and a line that works."""

from __future__ import annotations

import pickle
import pydoc
import re
from pathlib import Path

import numpy as np
import pytest

import raymarch as rm
import raymarch.sdf
from raymarch.sdf.definition import REGISTRY, Definition
from tests.support.node_samples import definitions

ROOT = Path(rm.__file__).parents[1]
PUBLIC = [name for name in dir(raymarch.sdf) if name in REGISTRY and REGISTRY[name] in definitions()]


def test_messages_name_what_was_called() -> None:
    """Each definition is called as a public function or a method, also those that several functions make."""
    assert not [d.name for d in definitions() if not (hasattr(rm, d.called) or hasattr(rm.Node, d.called))]
    distances = np.full((8, 8, 8), 1.0)
    distances[3:5, 3:5, 3:5] = -1.0
    corners = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)], float)
    made = {
        "grid": rm.grid(distances),
        "isosurface": rm.isosurface(-distances, 0.5),
        "mesh": rm.mesh((corners, [(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)]), resolution=8),
        "glsl_node": rm.glsl_node("float ball(vec3 p) { return length(p) - 1.0; }", "ball"),
        "sketch": rm.sketch((0, 0)).line_to((1, 0)).line_to((0, 1)).close(),
        "implicit": rm.implicit(lambda p: p.x**4 + p.y**4 + p.z**4 - 1, 2),
    }
    for name, node in made.items():
        assert node.name == name and pickle.loads(pickle.dumps(node)).name == name
    with pytest.raises(rm.SceneError, match="taper: glsl_node is unbounded"):
        made["glsl_node"].taper(0.1)


def text_of(name: str) -> str:
    return pydoc.render_doc(getattr(raymarch.sdf, name), renderer=pydoc.plaintext)


@pytest.mark.parametrize("name", PUBLIC)
def test_help_tells_all(name: str) -> None:
    text, definition = text_of(name), REGISTRY[name]
    assert definition.doc.splitlines()[0] in text
    for parameter, domain in definition.domains.items():
        assert re.search(rf"^ +{parameter} : {re.escape(domain.legal)}", text, re.MULTILINE), parameter
    for fact in ("exactness", "Lipschitz", "bounds", "source"):
        assert re.search(rf"^ +{fact} : .", text, re.MULTILINE), fact
    file, line = re.search(r"source : (\S+), line (\d+)", text).groups()  # type: ignore[union-attr]
    lines = (ROOT / file).read_text().splitlines()[int(line) - 1 :]
    assert any(f"def {name}(" in row for row in lines[:16])  # after the decorator


@pytest.mark.parametrize("name", PUBLIC)
def test_the_example_works(name: str) -> None:
    found = re.search(r">>> (?:node = )?(.+?)(?:\.exactness\n +(.+))?\n", text_of(name))
    assert found or REGISTRY[name].arity == "many" or any(d.type is None for d in REGISTRY[name].domains.values())
    if found:
        node = eval(found[1], {"rm": rm})
        assert node.definition is _in_use(REGISTRY[name], found[1])
        assert found[2] == (repr(node.exactness) if REGISTRY[name].arity == "none" else None)


def _in_use(definition: Definition, call: str) -> Definition:
    return definition.flat if definition.flat is not None and "circle" in call else definition


def test_facts_are_those_of_the_node() -> None:
    text = text_of("torus")
    assert "minor : a number > 0; length; default 0.25" in text
    assert "exactness : exact" in text
    assert "bounds : (-1.25, -0.25, -1.25) to (1.25, 0.25, 1.25) at the defaults" in text
    assert "symmetry : x, y, z" in text
    assert "rm.torus(major=1.0, minor=0.25)" in text


def test_a_shape_of_ones_own_has_help() -> None:
    @rm.shape(exactness="bound", bounds=lambda radius: ((-radius,) * 3, (radius,) * 3), lipschitz=2.0)
    def cushion(p: rm.Node, radius: float = 0.7) -> object:
        """Soft."""
        return 2.0 * (rm.sdf.noise.max(p.x, p.y) - radius)  # type: ignore[attr-defined]

    assert "Soft." in str(cushion.__doc__)
    assert "Lipschitz : 2 at the defaults, by which the field is divided" in str(cushion.__doc__)
    assert "test_help.py" in str(cushion.__doc__)
    assert ">>> cushion(radius=0.7).exactness" in str(cushion.__doc__)
    assert np.isfinite(cushion().distance((0, 0, 0)))
