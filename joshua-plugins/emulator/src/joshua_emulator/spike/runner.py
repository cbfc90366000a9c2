"""Runs an uploaded program: the very ``.mpy`` in MicroPython, with the emulated hub as its hardware."""

from __future__ import annotations

import asyncio
import contextlib
import importlib.util
import os
import shutil
import subprocess
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

FIRMWARE = Path(__file__).with_name("firmware")
READ_SIZE = 4096


class NoMicroPythonError(Exception):
    """There is no MicroPython to run programs with. The message says how to get one."""


def micropython_command() -> list[str]:
    """How MicroPython is started. Raises NoMicroPythonError."""
    if importlib.util.find_spec("micropython_unix") is not None:
        return [sys.executable, "-m", "micropython_unix"]
    if program := shutil.which("micropython"):
        return [program]
    from joshua.tools import install

    raise NoMicroPythonError(
        "an emulated hub runs its programs in MicroPython, and none is installed: "
        f"{install('joshua-emulator', 'spike')}, or put the program micropython into PATH"
    )


class ProgramRunner:
    """One run of one program.

    Args:
        folder: holds the program's modules; ``module`` is imported first.
        answer: carries out a request of the program on the hardware and returns the answer.
        on_output: takes what the program prints; on_end: is called once, when it has ended.
    """

    def __init__(
        self,
        folder: Path,
        module: str,
        *,
        answer: Callable[[Sequence[str]], str],
        on_output: Callable[[bytes], None],
        on_end: Callable[[], None],
    ) -> None:
        self._answer = answer
        self._on_output = on_output
        self._on_end = on_end
        self._loop = asyncio.get_running_loop()
        self._requests = b""
        self._open: list[int] = []
        request_end, program_requests = os.pipe()
        program_answers, answer_end = os.pipe()
        self._answer_end = answer_end
        arguments = [program_requests, program_answers, folder, module, FIRMWARE]
        try:
            self._process = subprocess.Popen(
                [*micropython_command(), str(FIRMWARE / "boot.py"), *map(str, arguments)],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
                pass_fds=(program_requests, program_answers),
                bufsize=0,
                cwd=folder,
            )
        finally:
            os.close(program_requests)
            os.close(program_answers)
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._stdin, self._stdout = self._process.stdin.fileno(), self._process.stdout.fileno()
        os.set_blocking(self._stdin, False)
        self._watch(request_end, self._serve)
        self._watch(self._stdout, self._read)
        self._open += [request_end, answer_end]

    def write(self, data: bytes) -> None:
        """Write to the program's standard input; what it does not read in time is lost."""
        with contextlib.suppress(BlockingIOError, BrokenPipeError):
            os.write(self._stdin, data)

    def close(self) -> None:
        """End the program at once, without a call of ``on_end``. Idempotent."""
        if not self._open:
            return
        self._loop.remove_reader(self._stdout)
        self._loop.remove_reader(self._open[0])
        self._process.kill()
        self._process.wait()
        for stream in (self._process.stdin, self._process.stdout):
            if stream is not None:
                stream.close()
        for descriptor in self._open:
            os.close(descriptor)
        self._open.clear()

    def _watch(self, descriptor: int, action: Callable[[int], None]) -> None:
        os.set_blocking(descriptor, False)
        self._loop.add_reader(descriptor, action, descriptor)

    def _serve(self, descriptor: int) -> None:
        """Answer requests; a program waits for each answer, so that there is one line at a time."""
        with contextlib.suppress(BlockingIOError):
            self._requests += os.read(descriptor, READ_SIZE)
        *lines, self._requests = self._requests.split(b"\n")
        if not lines and not self._requests:
            self._loop.remove_reader(descriptor)  # the program ends
        for line in lines:
            with contextlib.suppress(BrokenPipeError):
                os.write(self._answer_end, self._answer(line.decode().split()).encode() + b"\n")

    def _read(self, descriptor: int) -> None:
        try:
            data = os.read(descriptor, READ_SIZE)
        except BlockingIOError:
            return
        if data:
            self._on_output(data)
        else:
            self.close()
            self._on_end()
