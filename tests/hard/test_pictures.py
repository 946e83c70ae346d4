"""The pairs of pictures on the page still show a fault and its mending."""

from __future__ import annotations

import numpy as np
import pytest

from tests.hard.pictures import FOLDER, Pair, drawn, file_of, pairs


@pytest.mark.parametrize("pair", pairs(), ids=lambda pair: pair.name)
def test_a_pair_differs_where_the_case_is_to_be_seen(pair: Pair) -> None:
    without, mended = (np.asarray(picture, int) for picture in drawn(pair, (90, 60)))
    assert (np.abs(without - mended).max(axis=-1) > 15).mean() > 0.02
    assert (FOLDER / file_of(pair)).exists()
