"""The drawing of the middle pose is that of its script, in the guide and on the page."""

from __future__ import annotations

import pytest
from draw_middle_pose import PICTURES, draw


@pytest.mark.parametrize("picture", PICTURES, ids=lambda path: path.parent.name)
def test_the_drawing_is_up_to_date(picture):
    assert picture.read_text(encoding="utf-8") == draw(), "run python tools/draw_middle_pose.py"
