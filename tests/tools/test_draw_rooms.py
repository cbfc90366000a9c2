"""The picture and the table of the architecture page show the rooms as the test of the arrows has them."""

from __future__ import annotations

from draw_rooms import PICTURE, draw, ideas, levels, stands_on


def test_the_picture_is_up_to_date():
    assert PICTURE.read_text(encoding="utf-8") == draw(), "run python tools/draw_rooms.py"


def test_every_room_has_its_row_in_the_table():
    assert set(ideas()) == set(stands_on())


def test_arrows_run_downwards():
    height_of = levels(stands_on())
    assert all(height_of[room] > height_of[name] for room, below in stands_on().items() for name in below)
