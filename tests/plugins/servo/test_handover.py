"""A driver that is started again while the guardian of the one before still has the port."""

from __future__ import annotations

import subprocess
import sys
import threading
import time
from collections.abc import Iterator

import pytest
from joshua.node.errors import Cancelled
from joshua_emulator import EmulatedBus
from joshua_serial.errors import PortGuarded
from joshua_serial.port import SerialPort
from joshua_serial.usb_ports import Endpoint
from joshua_servo import handover
from joshua_servo.handover import open_unguarded

AT_WORK = """
import sys
from joshua.guardian.order import PROCESS_TITLE
from joshua.ipc.process_attributes import set_title
from joshua_serial.port import SerialPort
from joshua_serial.usb_ports import Endpoint
set_title(PROCESS_TITLE)
SerialPort(Endpoint(sys.argv[1]), 1_000_000).open()
print("at work", flush=True)
sys.stdin.read()
"""


@pytest.fixture
def port() -> Iterator[SerialPort]:
    with EmulatedBus(ids=(1,)) as emulator:
        port = SerialPort(Endpoint(emulator.port), 1_000_000)
        yield port
        port.close()


@pytest.fixture
def guardian(port: SerialPort) -> Iterator[subprocess.Popen[str]]:
    """A process that looks like a guardian and has the port."""
    process = subprocess.Popen(
        [sys.executable, "-c", AT_WORK, port.endpoint.path],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    assert process.stdout is not None
    assert process.stdout.readline() == "at work\n"
    with process:
        yield process
        process.kill()


def test_it_waits_until_the_guardian_has_ended(port: SerialPort, guardian: subprocess.Popen[str]) -> None:
    assert guardian.stdin is not None
    timer = threading.Timer(0.2, guardian.stdin.close)
    began_s = time.monotonic()
    timer.start()
    open_unguarded(port, lambda: False)
    assert port.is_open
    assert time.monotonic() - began_s > 0.2
    timer.join()


def test_a_guardian_is_named_as_what_it_is(
    port: SerialPort, guardian: subprocess.Popen[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(handover, "PATIENCE_S", 0.1)
    with pytest.raises(
        PortGuarded, match=rf"a guardian \(process {guardian.pid}\) is bringing .*It ends within seconds"
    ):
        open_unguarded(port, lambda: False)
    with pytest.raises(Cancelled):
        open_unguarded(port, lambda: True)
