"""The table as text: live rows, and lines for a log."""

from __future__ import annotations

import io

from calibration_hand import Hand
from joshua_calibration.front_end import ArmState, Board
from joshua_calibration.table import board_lines, event_text
from joshua_calibration.target import TargetMotor
from joshua_calibration.terminal import TerminalFrontEnd

MOTORS = (TargetMotor(1, "base"), TargetMotor(2, "a_joint_with_a_long_name"))


def board(hand: Hand) -> Board:
    arms = (("leader_arm", ArmState.DONE), ("follower_arm", ArmState.ACTIVE))
    return Board("rig", arms, 1, hand.procedure.view())


def swept() -> Hand:
    hand = Hand(MOTORS, [2048, 2048], [1024, 512])
    hand.take_home()
    hand.move({0: 1024})
    hand.move({0: 2560})
    return hand


def test_rows_show_range_and_present_position():
    lines = board_lines(board(swept()), 110)
    assert lines[0] == "Calibration of rig: * leader_arm  > follower_arm"
    assert lines[1] == "middle pose done > [ranges] > review > write"
    row = lines[3]
    assert row.startswith("> 1 base             [············━━")
    assert row.rstrip().endswith("+45.0    -90.0  ..   +45.0?  100%")
    assert row.count("●") == 1
    assert lines[4].startswith("  2 a_joint_with_a_l [")


def test_signs_beyond_ascii_can_be_left_out():
    text = "\n".join(board_lines(board(swept()), 110, unicode=False))
    assert "...====" in text
    assert "=O" in text
    text.encode("ascii")


def test_no_line_is_wider_than_the_terminal():
    for width in (20, 60, 79, 110, 200):
        assert all(len(line) <= width for line in board_lines(board(swept()), width))


def test_a_log_has_a_line_for_each_change_and_no_more():
    hand = Hand(MOTORS, [2048, 2048], [1024, 512])
    first = board(hand)
    assert event_text(None, first).startswith("follower_arm: Hold the arm so that every joint")
    hand.rest(3)
    assert event_text(first, board(hand)) == ""
    before = board(hand)
    hand.procedure.repeat(0)
    assert (
        event_text(before, board(hand))
        == "follower_arm: refused: This joint cannot be repeated at this step."
    )
    hand.finish()
    assert event_text(before, board(hand)).splitlines()[1] == "  base               -90.0  ..   +90.0"


def test_a_stream_without_a_descriptor_is_written_to_and_never_asked():
    screen = io.StringIO()
    front_end = TerminalFrontEnd(io.StringIO("\n"), screen)
    front_end.show(board(swept()))
    front_end.say("a line")
    assert not front_end.can_ask
    assert front_end.requests() == []
    front_end.close()
    front_end.close()
    assert screen.getvalue().splitlines()[-1] == "a line"
    assert "\x1b" not in screen.getvalue()


def test_a_reader_that_has_gone_ends_no_calibration():
    class Closed(io.StringIO):
        def write(self, text: str) -> int:
            raise BrokenPipeError(text)

    front_end = TerminalFrontEnd(io.StringIO(), Closed())
    front_end.show(board(swept()))
    front_end.say("leader_arm is calibrated")
    front_end.close()
