"""Records commands in a terminal and draws what it shows as SVG, still or in motion.

The commands really run, in a shell on a pseudo-terminal. The picture is text, so it stays small and sharp.
"""

from __future__ import annotations

import fcntl
import os
import pty
import select
import signal
import struct
import termios
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from html import escape
from pathlib import Path

import pyte

#: Lines of the emulated screen: nothing scrolls out of it, a picture shows a part.
LINES = 400
FONT = "DejaVu Sans Mono, Menlo, Consolas, monospace"
FONT_SIZE, CELL, LINE, MARGIN, BAR = 14, 8.43, 19, 14, 30
BACKGROUND, FOREGROUND, PROMPT = "#263238", "#eceff1", "$ "
COLOURS = {
    "default": FOREGROUND,
    "black": "#546e7a",
    "red": "#ef9a9a",
    "green": "#a5d6a7",
    "brown": "#ffe082",
    "blue": "#90caf9",
    "magenta": "#ce93d8",
    "cyan": "#80deea",
    "white": "#ffffff",
}
#: Pauses are shortened to this, and what comes within one frame is one.
LONGEST_PAUSE_S, FRAME_S, LAST_FRAME_S = 1.2, 0.06, 5.0

#: A run of characters in one style: first column, text, colour, bold, dim.
Run = tuple[int, str, str, bool]
Row = tuple[Run, ...]


@dataclass(frozen=True)
class Type:
    """Types a line and waits until its output shows a text, or until the prompt is back.

    Attributes:
        until: text to wait for in what comes after; "" waits for the prompt.
        linger_s: time to wait after that.
        then: keys to press after that, such as Ctrl-C; key_s: time after each.
        look: called at last, with everything shown so far; the program then ends with its terminal.
    """

    line: str
    until: str = ""
    then: str = ""
    linger_s: float = 0.0
    look: Callable[[bytes], None] | None = None
    key_s: float = 0.2


@dataclass
class Recording:
    """What a terminal received, with times in seconds from the start."""

    columns: int
    chunks: list[tuple[float, bytes]] = field(default_factory=list)

    def frames(self) -> list[tuple[float, list[Row], int]]:
        """Return the screens that differ: time, rows and the row of the cursor."""
        screen = pyte.Screen(self.columns, LINES)
        stream = pyte.ByteStream(screen)
        frames: list[tuple[float, list[Row], int]] = []
        now_s = shown_s = 0.0
        for index, (time_s, data) in enumerate(self.chunks):
            now_s += min(time_s - (self.chunks[index - 1][0] if index else time_s), LONGEST_PAUSE_S)
            stream.feed(data)
            if frames and now_s - shown_s < FRAME_S and index + 1 < len(self.chunks):
                continue
            rows = [row_of(screen, line) for line in range(screen.cursor.y + 1)]
            if not frames or rows != frames[-1][1]:
                frames.append((now_s, rows, screen.cursor.y))
                shown_s = now_s
        return frames


def row_of(screen: pyte.Screen, line: int) -> Row:
    """Return the runs of equal style of one line, without the blanks at its end."""
    cells = screen.buffer[line]
    runs: list[Run] = []
    for column in range(screen.columns):
        cell = cells[column]
        style = (COLOURS.get(cell.fg, f"#{cell.fg}" if len(cell.fg) == 6 else FOREGROUND), cell.bold)
        if runs and runs[-1][2:] == style and runs[-1][0] + len(runs[-1][1]) == column:
            runs[-1] = (runs[-1][0], runs[-1][1] + cell.data, *style)
        else:
            runs.append((column, cell.data, *style))
    return tuple(run for run in ((at, text.rstrip(), *style) for at, text, *style in runs) if run[1])  # type: ignore[misc]


def record(
    steps: Sequence[Type], *, columns: int, folder: Path, rows: int = 40, timeout_s: float = 120.0
) -> Recording:
    """Run lines in a shell on a terminal of its own, and record what it shows.

    Args:
        folder: in which the shell starts.
        columns, rows: size of the terminal that the programs see.

    Raises:
        TimeoutError: a step does not show what it waits for.
    """
    process, terminal = pty.fork()
    if process == 0:
        os.chdir(folder)
        environment = {**os.environ, "PS1": PROMPT, "TERM": "xterm-256color", "HISTFILE": ""}
        for name in ("COLUMNS", "LINES", "NO_COLOR", "PROMPT_COMMAND"):
            environment.pop(name, None)
        os.execvpe("bash", ["bash", "--norc", "--noprofile", "-i"], environment)
    fcntl.ioctl(terminal, termios.TIOCSWINSZ, struct.pack("HHHH", rows, columns, 0, 0))
    recording = Recording(columns)
    begin_s = time.monotonic()

    shown = bytearray()

    def receive(wait_s: float, until: str = "", since: int = 0) -> None:
        """Record for a time, or until a text is shown behind a place in what was shown."""
        deadline_s = time.monotonic() + wait_s
        while not until or until.encode() not in shown[since:]:
            left_s = deadline_s - time.monotonic()
            if left_s <= 0 and until:
                raise TimeoutError(
                    f"{until!r} was not shown within {wait_s:g} s, but {shown[since:].decode()!r}"
                )
            if left_s <= 0:
                return
            if select.select([terminal], [], [], min(left_s, 0.05))[0]:
                data = os.read(terminal, 65536)
                recording.chunks.append((time.monotonic() - begin_s, data))
                shown.extend(data)

    try:
        receive(timeout_s, PROMPT)
        for step in steps:
            for key in step.line:
                os.write(terminal, key.encode())
                receive(0.03)
            mark = len(shown)
            os.write(terminal, b"\r")
            if step.until:
                receive(timeout_s, step.until, mark)
                receive(step.linger_s)
                mark = len(shown)
                for key in step.then:
                    os.write(terminal, key.encode())
                    receive(step.key_s)
            if step.look is not None:
                step.look(bytes(shown))
                break
            receive(timeout_s, PROMPT, mark)
    finally:
        os.kill(process, signal.SIGHUP)
        os.close(terminal)
        os.waitpid(process, 0)
    return recording


def still(recording: Recording, *, title: str, start: str = "", end: str = "") -> str:
    """Draw the last screen, or a part of it below the last line that was typed.

    Args:
        title: for readers that cannot see the picture.
        start: a text in the first line of the part, which is the last line with that text; "" for everything.
        end: likewise of the line behind the part.
    """
    rows = recording.frames()[-1][1]
    while rows and rows[-1] in ((), ((0, PROMPT.strip(), FOREGROUND, False),)):
        rows = rows[:-1]
    lines = [" ".join(run[1] for run in row) for row in rows]

    def last(text: str) -> int:
        return max(index for index, line in enumerate(lines) if text in line)

    shown = rows
    if start:
        typed, begin = last(PROMPT.strip() + " "), last(start)
        gap = [((0, "…", "#90a4ae", False),)] if begin > typed + 1 else []
        shown = [rows[typed], *gap, *rows[begin : last(end) if end else None]]
    while shown and not shown[-1]:
        shown = shown[:-1]
    body = "".join(_text(row, index) for index, row in enumerate(shown))
    return _svg(body, recording.columns, len(shown), title, "")


def moving(recording: Recording, *, title: str, lines: int) -> str:
    """Draw the session in motion, in a window of so many lines. Readers who want no motion get its end."""
    frames = recording.frames()
    total_s = frames[-1][0] + LAST_FRAME_S
    spans: list[tuple[int, Row, float, float]] = []  # line, content, from, to
    open_rows: dict[int, tuple[Row, float]] = {}
    for time_s, rows, _ in [*frames, (total_s, [], 0)]:
        for line in range(max(len(rows), *(index + 1 for index in open_rows), 1) if open_rows else len(rows)):
            now = rows[line] if line < len(rows) else ()
            before, since_s = open_rows.get(line, ((), 0.0))
            if now != before:
                if before:
                    spans.append((line, before, since_s, time_s))
                open_rows[line] = (now, time_s)
    styles, body = [], []
    for number, (line, row, from_s, to_s) in enumerate(sorted(spans, key=lambda span: span[0])):
        is_last = to_s >= total_s
        steps = [f"0%{{visibility:{'hidden' if from_s else 'visible'}}}"] if from_s else []
        steps.append(f"{from_s / total_s:.3%}{{visibility:visible}}")
        if not is_last:
            steps.append(f"{to_s / total_s:.3%},to{{visibility:hidden}}")
        styles.append(f"@keyframes r{number}{{{''.join(steps)}}}#r{number}{{animation-name:r{number}}}")
        body.append(f'<g id="r{number}" class="{"l" if is_last else "r"}">{_text(row, line)}</g>')
    shifts = [(time_s, max(cursor + 1 - lines, 0)) for time_s, _, cursor in frames]
    moves = [shift for index, shift in enumerate(shifts) if not index or shift[1] != shifts[index - 1][1]]
    scroll = "".join(f"{t / total_s:.3%}{{transform:translateY(-{n * LINE}px)}}" for t, n in moves)
    end = shifts[-1][1] * LINE
    style = (
        f".r,.l,#s{{animation:{total_s:.1f}s step-end infinite}}.r{{visibility:hidden}}"
        f"@keyframes s{{{scroll}}}#s{{animation-name:s;transform:translateY(-{end}px)}}{''.join(styles)}"
        "@media (prefers-reduced-motion:reduce){.r,.l,#s{animation:none!important}}"
    )
    inner = (
        f'<svg y="{BAR}" width="100%" height="{lines * LINE + MARGIN}">'
        f'<g id="s"><g transform="translate(0 {-BAR})">{"".join(body)}</g></g></svg>'
    )
    return _svg(inner, recording.columns, lines, title, style)


def _text(row: Row, line: int) -> str:
    y = BAR + MARGIN + line * LINE
    spans = []
    for column, text, colour, bold in row:
        indent = len(text) - len(text.lstrip())
        shown = text.lstrip()
        style = (f' fill="{colour}"' if colour != FOREGROUND else "") + (' font-weight="700"' if bold else "")
        spans.append(
            f'<text x="{MARGIN + (column + indent) * CELL:.1f}" y="{y}" textLength="{len(shown) * CELL:.1f}"'
            f"{style}>{escape(shown, quote=False)}</text>"
        )
    return "".join(spans)


def _svg(body: str, columns: int, lines: int, title: str, style: str) -> str:
    width, height = round(columns * CELL + 2 * MARGIN), lines * LINE + BAR + MARGIN
    dots = "".join(
        f'<circle cx="{20 + 18 * index}" cy="16" r="5" fill="{colour}"/>'
        for index, colour in enumerate(("#ef9a9a", "#ffe082", "#a5d6a7"))
    )
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" font-family="{FONT}" '
        f'font-size="{FONT_SIZE}" fill="{FOREGROUND}" xml:space="preserve" role="img">\n'
        f"<title>{escape(title)}</title>\n<style>{style}text{{white-space:pre}}</style>\n"
        f'<rect width="{width}" height="{height}" rx="9" fill="{BACKGROUND}"/>{dots}\n{body}\n</svg>\n'
    )
