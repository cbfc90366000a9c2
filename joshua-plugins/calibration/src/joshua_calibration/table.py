"""The live table as text: one row per joint with present position, range and what is missing."""

from __future__ import annotations

from joshua_calibration.front_end import ArmState, Board
from joshua_calibration.view import JointState, JointView, Step, View

SPAN_DEG = 180.0  # characters to either side of the middle
SMALLEST_WIDTH = 60

_MARKS = {
    JointState.WAITING: " ",
    JointState.ACTIVE: ">",
    JointState.COMPLETE: "+",
    JointState.DONE: "*",
    JointState.REFUSED: "!",
}
_STEPS = (
    (Step.HOMING, "middle pose"),
    (Step.SWEEP, "ranges"),
    (Step.REVIEW, "review"),
    (Step.WRITE, "write"),
)
_KEYS = {
    "confirm": "Enter confirm",
    "back": "b back to the middle pose",
    "repeat": "1-9 repeat a joint",
}


def board_lines(board: Board, width: int, *, unicode: bool = True) -> list[str]:
    """Return the whole table, each line at most ``width`` characters.

    Args:
        unicode: whether non-ASCII characters can be shown.
    """
    view = board.view
    lines = [_arms_line(board), _steps_line(view), ""]
    lines += [
        joint_line(number, joint, max(width, SMALLEST_WIDTH), unicode)
        for number, joint in enumerate(view.joints, 1)
    ]
    lines += ["", *wrapped(view.instruction, width)]
    lines += (
        wrapped(f"! {view.message}" if view.is_problem else view.message, width) if view.message else [""]
    )
    keys = [text for command, text in _KEYS.items() if command in view.commands]
    lines.append("   ".join([*keys, "q quit"]))
    return [line[:width] for line in lines]


def joint_line(number: int, joint: JointView, width: int, unicode: bool) -> str:
    """Return one row: mark, name, bar, range and present position in degrees."""
    head = f"{_MARKS[joint.state]} {number} {joint.name[:16]:<16} "
    present = f"{joint.present_deg:+7.1f}" if joint.present_deg is not None else "      ?"
    tail = f" {present}  {_end(joint.low_deg, joint.low_found)} .. {_end(joint.high_deg, joint.high_found)}"
    tail += f"  {joint.coverage:4.0%}  {joint.note}"
    room = width - len(head) - len(tail) - 2
    bar = bar_text(joint, max(8, min(48, room)), unicode)
    return f"{head}{bar}{tail}".rstrip()


def bar_text(joint: JointView, cells: int, unicode: bool) -> str:
    """Return the bar: half a turn to either side of the middle, with range and present position."""
    nothing, seen, here, middle = "·━●┊" if unicode else ".=O|"
    bar = [nothing] * cells
    bar[cells // 2] = middle

    def cell(degrees: float) -> int:
        share = (degrees + SPAN_DEG) / (2 * SPAN_DEG)
        return min(max(int(share * cells), 0), cells - 1)

    if joint.low_deg is not None and joint.high_deg is not None:
        for index in range(cell(joint.low_deg), cell(joint.high_deg) + 1):
            bar[index] = seen
    if joint.present_deg is not None:
        bar[cell(joint.present_deg)] = here
    return f"[{''.join(bar)}]"


def event_text(before: Board | None, board: Board) -> str:
    """Return the changes as a log line; "" for none."""
    view = board.view
    name = board.arms[board.arm][0]
    if (
        before is None
        or (before.arm, before.view.step, before.view.active)
        != (
            board.arm,
            view.step,
            view.active,
        )
        or before.view.instruction != view.instruction
    ):
        text = f"{name}: {view.instruction}"
    elif view.message and before.view.message != view.message:
        return f"{name}: {'refused: ' if view.is_problem else ''}{view.message}"
    else:
        return ""
    done = view.joints if view.step is Step.REVIEW else ()
    rows = [
        f"  {j.name:<16} {_end(j.low_deg, True)} .. {_end(j.high_deg, True)}  {j.note}".rstrip() for j in done
    ]
    return "\n".join([text, *rows])


def wrapped(text: str, width: int) -> list[str]:
    """Wrap text to ``width`` characters, keeping line breaks."""
    import textwrap

    return [part for line in text.splitlines() for part in textwrap.wrap(line, max(20, width)) or [""]]


def _end(degrees: float | None, is_found: bool) -> str:
    return "      ? " if degrees is None else f"{degrees:+7.1f}{' ' if is_found else '?'}"


def _arms_line(board: Board) -> str:
    signs = {ArmState.WAITING: " ", ArmState.ACTIVE: ">", ArmState.DONE: "*", ArmState.STOPPED: "!"}
    arms = "  ".join(f"{signs[state]} {name}" for name, state in board.arms)
    return f"Calibration of {board.title}: {arms}"


def _steps_line(view: View) -> str:
    order = [step for step, _ in _STEPS]
    at = order.index(view.step) if view.step in order else len(order)
    parts = [
        f"[{name}]" if index == at else f"{name} done" if index < at else name
        for index, (_, name) in enumerate(_STEPS)
    ]
    return " > ".join(parts)
