"""``MODE_CALIBRATION``: arm by arm, in the terminal and the browser, without starting nodes."""

from __future__ import annotations

import signal
import sys
import time
from contextlib import ExitStack
from typing import TYPE_CHECKING

from joshua.tools import ExitCode

from joshua_calibration.arms import (
    Refused,
    find_arms,
    open_arms,
    plan_of,
    recover_arms,
    taken,
)

if TYPE_CHECKING:
    import argparse
    from collections.abc import Sequence

    from joshua.tools import Checked, EmulatedRig

    from joshua_calibration.front_end import FrontEnd
    from joshua_calibration.page.front_end import PageFrontEnd
    from joshua_calibration.session import Arm, Session

STOP_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


def run_calibration(checked: Checked, arguments: argparse.Namespace, rig: EmulatedRig | None) -> int:
    """Calibrate the arms of a file and return the exit code."""
    with ExitStack() as stack:
        try:
            plan, previous = plan_of(checked, arguments)
            only = getattr(arguments, "nodes", None) or ()
            arms = find_arms(plan, previous, rig=rig, simulated=arguments.sim, only=only)
            stop = Stop(plan.duration_s)
            stack.enter_context(stop)
            taken(plan, arms, stop.order, stack)
            open_arms(arms, stack)
            recover_arms(arms)
            display = checked.loaded.config.calibration_run.display or arguments.open
            front_ends = _front_ends(stack, display=display, open_page=arguments.open)
            scripted = _is_scripted(front_ends, arms, "simulated" if rig is None else "emulated")
        except Refused as error:
            if str(error):
                sys.stderr.write(
                    f"joshua: error: {error}\n" if error.code != ExitCode.INVALID else f"{error}\n"
                )
            return error.code
        from joshua_calibration.session import Session

        session = Session(plan.robot_name or plan.robot_id, arms, front_ends, stop, scripted=scripted)
        return _conclude(session, arms, front_ends)


class Stop:
    """Stop condition of the run, a signal or a duration; a context manager that handles the signals.

    Args:
        duration_s: length of the run; None for no end.
    """

    def __init__(self, duration_s: float | None) -> None:
        self._end_s = None if duration_s is None else time.monotonic() + duration_s
        self._signalled = False
        self._former: list[tuple[int, object]] = []

    def __call__(self) -> bool:
        """Return whether to end now."""
        return self._signalled or (self._end_s is not None and time.monotonic() >= self._end_s)

    def __enter__(self) -> Stop:
        for number in STOP_SIGNALS:
            self._former.append((number, signal.signal(number, self._note)))
        return self

    def __exit__(self, *_: object) -> None:
        while self._former:
            number, handler = self._former.pop()
            signal.signal(number, handler)  # type: ignore[arg-type]

    def order(self) -> None:
        """End the run."""
        self._signalled = True

    def _note(self, *_: object) -> None:
        # Never raise here: an exception during a write would leave the servos between two calibrations.
        self._signalled = True


def _front_ends(stack: ExitStack, *, display: bool, open_page: bool) -> list[FrontEnd]:
    from joshua_calibration.terminal import TerminalFrontEnd

    front_ends: list[FrontEnd] = []
    if display:
        from joshua_calibration.page.front_end import PageFrontEnd

        page = PageFrontEnd()
        stack.callback(page.close)
        front_ends.append(page)
        sys.stdout.write(f"page: {page.address}\n")
        sys.stdout.flush()
        if open_page:
            _open(page)
    terminal = TerminalFrontEnd(sys.stdin, sys.stdout)
    stack.callback(terminal.close)
    return [terminal, *front_ends]


def _open(page: PageFrontEnd) -> None:
    import os
    import webbrowser

    # Without a display, a text browser would open in this terminal.
    has_screen = sys.platform == "darwin" or os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
    if not (has_screen and webbrowser.open(page.opening_address())):
        port = page.address.split(":")[2].partition("/")[0]
        sys.stdout.write(
            "no browser can be opened here: open the address by hand, or use the table below. Over SSH, "
            f"`ssh -L {port}:127.0.0.1:{port} HOST` on your own machine makes the address work there\n"
        )
        sys.stdout.flush()


def _is_scripted(front_ends: Sequence[FrontEnd], arms: Sequence[Arm], kind: str) -> bool:
    """Return whether to confirm automatically, without a user; arms then move by themselves.

    Args:
        kind: of arms that move by themselves: ``emulated`` or ``simulated``.

    Raises Refused.
    """
    moves_itself = any(arm.guide is not None for arm in arms)
    if sys.stdin is not None and not sys.stdin.closed and _has_input():
        if moves_itself:
            sys.stdout.write(f"{kind} arms move by themselves: confirm each step once it is complete\n")
            sys.stdout.flush()
        return False
    if all(arm.guide is not None for arm in arms):
        sys.stdout.write(f"no terminal to confirm in: the {kind} arms perform all steps by themselves\n")
        return True
    if len(front_ends) > 1:
        return False
    raise Refused(
        "no terminal to confirm in: run the command in a terminal, or add --open to use the browser",
        ExitCode.INVALID,
    )


def _has_input() -> bool:
    """Return whether standard input is a terminal, or a pipe that may deliver lines."""
    import os
    import stat

    try:
        if sys.stdin.isatty():
            return True
        mode = os.fstat(sys.stdin.fileno()).st_mode
    except (OSError, ValueError):
        return False
    return stat.S_ISFIFO(mode) or stat.S_ISSOCK(mode) or stat.S_ISREG(mode)


def _conclude(session: Session, arms: Sequence[Arm], front_ends: Sequence[FrontEnd]) -> int:
    """Run the session and print for each arm whether it is calibrated."""
    from joshua_calibration.front_end import ArmState
    from joshua_calibration.session import Stopped, Unfinished
    from joshua_calibration.transaction import NotWritten

    code, reason = ExitCode.OK, ""
    try:
        session.run()
    except Stopped:
        reason = "stopped"
    except (NotWritten, Unfinished) as error:
        code, reason = ExitCode.FAILED, str(error)
    done = [arm.node_name for arm in arms if arm.state is ArmState.DONE]
    rest = [arm.node_name for arm in arms if arm.state is not ArmState.DONE]
    lines = [reason] if code else []
    if done:
        lines.append(
            f"calibrated: {', '.join(done)}. Run joshua calibrate --check to compare file and servos."
        )
        lines.append(
            "A joint that turns the other way than its partner on the other arm is mirrored: set inverted: "
            f"true in its entry of {next(arm.file.path for arm in arms if arm.state is ArmState.DONE)}."
        )
    if rest:
        lines.append(f"{reason if not code else 'ended'}; not calibrated: {', '.join(rest)}.")
        if not code:
            lines.append("Nothing changed. The old calibration is still used.")
    text = "\n".join(lines)
    board = session.board(text)
    for front_end in reversed(front_ends):
        front_end.show(board)
        front_end.close()
    (sys.stderr if code else sys.stdout).write(text + "\n")
    return code
