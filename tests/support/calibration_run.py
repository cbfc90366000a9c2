"""A calibration through the real program, on an emulated arm that the test moves by hand."""

from __future__ import annotations

import codecs
import json
import os
import pty
import re
import select
import subprocess
import sysconfig
import time
import urllib.request
from collections.abc import Callable
from pathlib import Path
from typing import Any

from joshua.testing.port import free_port
from joshua_emulator import EmulatedBus

JOSHUA = Path(sysconfig.get_path("scripts")) / "joshua"
ROBOT = """
general {{ mode: {mode} robot_type: "SO-ARM100" name: "one arm" id: "rig" }}
transport {{ listen_endpoints: "tcp/localhost:{router}" }}
{more}
robot {{ actions {{
  node {{ node_name: "leader_arm" node_id: 1 node_type: PYTHON
    publishers {{ data_type: JOINT_STATE topic_name: "/leader" publish_rate_hz: 50 }} }}
  action_type: ACTION_LEADER
  sts3215_config {{ comm {{ serial {{ port: "{port}" baudrate: 1000000 }} }} motor_ids: [{ids}]
    position_max: 4095 }}
}} }}
"""
ANSI = re.compile(r"\x1b\[[?0-9;]*[A-Za-z]")
CUT_OFF = re.compile(r"\x1b(\[[?0-9;]*)?$")  # a piece of the output may end in the midst of a sequence


def environment(folder: Path, domain_id: int) -> dict[str, str]:
    runtime = folder / "run"
    runtime.mkdir(mode=0o700, exist_ok=True)
    return {
        **os.environ,
        "ROS_DOMAIN_ID": str(domain_id),
        "XDG_RUNTIME_DIR": str(runtime),
        "XDG_STATE_HOME": str(folder / "state"),
        "TERM": "xterm",
    }


def robot(
    folder: Path, port: str, *, mode: str = "MODE_CALIBRATION", more: str = "", ids: str = "1, 2, 3, 4, 5, 6"
) -> Path:
    path = folder / "robot.pbtxt"
    path.write_text(ROBOT.format(mode=mode, port=port, more=more, ids=ids, router=free_port()))
    return path


class CalibrationRun:
    """``joshua`` in a process of its own, with a pipe or a pseudo-terminal on its standard streams."""

    def __init__(self, words: list[str], env: dict[str, str], *, terminal: bool = False) -> None:
        self.text = ""
        self._decoder = codecs.getincrementaldecoder("utf-8")(errors="replace")
        self._pending = ""
        self._master = -1
        command = [str(JOSHUA), *words]
        if terminal:
            self._master, slave = pty.openpty()
            self.process = subprocess.Popen(command, stdin=slave, stdout=slave, stderr=slave, env=env)
            os.close(slave)
            self._output = self._master
        else:
            self.process = subprocess.Popen(
                command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, env=env
            )
            assert self.process.stdout is not None
            self._output = self.process.stdout.fileno()

    def __enter__(self) -> CalibrationRun:
        return self

    def __exit__(self, *_: object) -> None:
        if self.process.poll() is None:
            self.process.kill()
        self.process.wait()
        for stream in (self.process.stdin, self.process.stdout):
            if stream is not None:
                stream.close()
        if self._master >= 0:
            os.close(self._master)

    def press(self, keys: str) -> None:
        if self._master >= 0:
            os.write(self._master, keys.encode())
        else:
            assert self.process.stdin is not None
            self.process.stdin.write(keys.encode())
            self.process.stdin.flush()

    def wait_for(
        self,
        text: str,
        *,
        since: int = 0,
        timeout_s: float = 60.0,
        again: Callable[[], object] | None = None,
        every_s: float = 3.0,
    ) -> int:
        """Waits until the output holds a text after a place; returns the place behind it.

        Args:
            again: what a person does now, and once more whenever ``every_s`` have passed without the text.
        """
        deadline_s = time.monotonic() + timeout_s
        again_s = 0.0
        while text not in self.text[since:]:
            now_s = time.monotonic()
            if again is not None and now_s >= again_s:
                again()
                again_s = time.monotonic() + every_s
            if now_s > deadline_s or (not self._read(0.1) and self.process.poll() is not None):
                while self._read(0.1):
                    pass
                if text in self.text[since:]:
                    break
                raise AssertionError(f"no {text!r} in:\n{self.text[-4000:]}")
        return self.text.index(text, since) + len(text)

    def wait_until(self, condition: Callable[[], bool], timeout_s: float = 60.0) -> None:
        """Waits for a condition, and reads meanwhile: a program that cannot write stands still."""
        deadline_s = time.monotonic() + timeout_s
        while not condition():
            assert time.monotonic() < deadline_s, self.text[-4000:]
            self._read(0.02)

    def rest(self, seconds: float) -> None:
        """Does nothing but read."""
        end_s = time.monotonic() + seconds
        self.wait_until(lambda: time.monotonic() >= end_s)

    def end(self, timeout_s: float = 60.0) -> int:
        """Waits for the end; returns the exit code."""
        deadline_s = time.monotonic() + timeout_s
        while self.process.poll() is None and time.monotonic() < deadline_s:
            self._read(0.05)
        while self._read(0.1):
            pass
        assert self.process.poll() is not None, self.text[-4000:]
        return int(self.process.returncode)

    def _read(self, timeout_s: float) -> bool:
        if not select.select([self._output], [], [], timeout_s)[0]:
            return False
        try:
            data = os.read(self._output, 65536)
        except OSError:
            return False
        shown = self._pending + self._decoder.decode(data)
        cut = CUT_OFF.search(shown)
        end = cut.start() if cut else len(shown)
        self._pending = shown[end:]
        self.text += ANSI.sub("", shown[:end]).replace("\r", "")
        return bool(data)


def sweep_all(
    run: CalibrationRun, emulator: EmulatedBus, confirm: Callable[[], object], *, seconds: float = 1.0
) -> None:
    """Plays the person: middle pose, and each joint through its range as the program asks.

    What the program refuses, because it was late and has not seen it, is done once more.
    """
    place = run.wait_for("middle of its range")
    emulator.guide(None, 0.3)
    run.rest(0.9)
    place = run.wait_for("Move shoulder_pan from", since=place, again=confirm)
    home = [servo["angle"] for servo in emulator.servos()]
    for slot in range(6):
        name = ("shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_flex", "wrist_roll", "gripper")[slot]
        if slot:
            place = run.wait_for(f"Move {name} from", since=place)

        def move(slot: int = slot) -> None:
            emulator.guide(slot, seconds)

        place = run.wait_for(f"{name} is complete", since=place, again=move, every_s=seconds + 4.0)

        def is_back(slot: int = slot) -> bool:
            return bool(abs(emulator.servos()[slot]["angle"] - home[slot]) < 3)

        run.wait_until(is_back)
        confirm()
    run.wait_for("Every joint is complete", since=place)


class Page:
    """A browser's side of the page, by hand: each request as a browser would send it."""

    def __init__(self, address: str) -> None:
        self.address = address
        self.origin = address.rsplit("/", 2)[0]

    def get(self, name: str = "", **headers: str) -> tuple[int, dict[str, str], bytes]:
        return self._open(urllib.request.Request(self.address + name, headers=headers))

    def ask(self, body: object, **headers: str) -> int:
        data = body if isinstance(body, bytes) else json.dumps(body).encode()
        values = {"Origin": self.origin, "Content-Type": "application/json", **headers}
        values = {name.replace("_", "-"): value for name, value in values.items() if value}
        request = urllib.request.Request(f"{self.address}ask", data=data, headers=values)
        if not values.get("Content-Type"):
            request.add_unredirected_header("Content-Type", "")
        return self._open(request)[0]

    def board(self) -> dict[str, Any]:
        """The newest board of the stream."""
        with urllib.request.urlopen(f"{self.address}events", timeout=60) as stream:
            line = stream.readline()
        return dict(json.loads(line.removeprefix(b"data: ")))

    @staticmethod
    def _open(request: urllib.request.Request) -> tuple[int, dict[str, str], bytes]:
        try:
            with urllib.request.urlopen(request, timeout=60) as answer:
                return answer.status, dict(answer.headers), answer.read()
        except urllib.error.HTTPError as error:
            with error:
                return error.code, dict(error.headers), error.read()
