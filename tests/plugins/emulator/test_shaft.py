"""The shaft that emulated encoders sit on."""

from __future__ import annotations

from joshua_emulator.encoder.shaft import Shaft


def test_a_shaft_that_is_let_go_turns_on_from_where_it_was_held() -> None:
    shaft = Shaft(100.0)
    turning = [shaft.angle_rad(100.0 + step) for step in (1.0, 1.5, 2.0)]
    shaft.hold(101.5)
    assert shaft.angle_rad(101.0) == turning[0]
    assert shaft.angle_rad(109.0) == turning[1]
    shaft.hold(105.0)  # is held already
    shaft.release(111.5)
    assert shaft.angle_rad(111.5) == turning[1]
    assert abs(shaft.angle_rad(112.0) - turning[2]) < 1e-9
    shaft.release(113.0)
    assert abs(shaft.angle_rad(112.0) - turning[2]) < 1e-9


def test_a_shaft_that_is_let_go_for_a_while_stands_still_afterwards_though_nobody_stops_it() -> None:
    shaft, free = Shaft(0.0), Shaft(0.0)
    shaft.hold(1.0)
    shaft.release(5.0, 0.5)
    assert shaft.angle_rad(5.25) == free.angle_rad(1.25)
    assert shaft.angle_rad(90.0) == free.angle_rad(1.5)
    shaft.release(100.0)
    assert abs(shaft.angle_rad(101.0) - free.angle_rad(2.5)) < 1e-9
