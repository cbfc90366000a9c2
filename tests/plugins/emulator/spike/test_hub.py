"""The firmware of the emulated hub by itself: commands, their order and refusals, as Pybricks has them."""

from __future__ import annotations

import asyncio
import struct
from collections.abc import Awaitable, Callable
from pathlib import Path

import hostile
import pytest
from joshua_emulator.event_log import EventLog
from joshua_emulator.spike.hub import MAX_PROGRAM_SIZE, Answer, Command, HubFirmware
from joshua_emulator.spike.motors import EmulatedMotor
from joshua_emulator.spike.program import OTHER_PROGRAM, ProgramError, pack, unpack, write_modules
from joshua_emulator.spike.runner import NoMicroPythonError, micropython_command
from mpy_cross_v6 import mpy_cross_compile

HubTest = Callable[[HubFirmware, list[bytes]], Awaitable[None]]


def compiled(source: str) -> bytes:
    process, code = mpy_cross_compile("main.py", source, small_number_bits=31)
    assert code is not None, process.stderr
    return pack(code)


def with_hub(test: HubTest) -> None:
    """Runs a test with a hub and the list of its events."""

    async def run() -> None:
        hub = HubFirmware({"A": EmulatedMotor(30.0)}, EventLog())
        events: list[bytes] = []
        hub.send = events.append
        try:
            await test(hub, events)
        finally:
            hub.close()

    asyncio.run(run())


def upload(hub: HubFirmware, blob: bytes) -> None:
    assert hub.command(struct.pack("<BI", Command.WRITE_META, 0)) is Answer.OK
    for offset in range(0, len(blob), 100):
        chunk = blob[offset : offset + 100]
        assert hub.command(struct.pack("<BI", Command.WRITE_RAM, offset) + chunk) is Answer.OK
    assert hub.command(struct.pack("<BI", Command.WRITE_META, len(blob))) is Answer.OK


async def ended(hub: HubFirmware) -> None:
    for _ in range(6000):
        if not hub.running:
            return
        await asyncio.sleep(0.01)
    raise AssertionError("the program did not end")


def printed(events: list[bytes]) -> str:
    return b"".join(event[1:] for event in events if event[0] == 1).decode()


def statuses(events: list[bytes]) -> list[bool]:
    return [bool(struct.unpack_from("<BI", event)[1] & 1 << 6) for event in events if event[0] == 0]


def test_an_uploaded_program_runs_and_what_it_prints_comes_in_small_pieces() -> None:
    async def test(hub: HubFirmware, events: list[bytes]) -> None:
        upload(hub, compiled("print('one line that is longer than nineteen bytes')\nprint(6 * 7)"))
        assert hub.command(bytes([Command.START])) is Answer.OK
        await ended(hub)
        assert printed(events) == "one line that is longer than nineteen bytes\r\n42\r\n"
        assert max(map(len, events)) <= 20
        assert statuses(events) == [True, False]

    with_hub(test)


def test_an_error_of_the_program_is_printed() -> None:
    async def test(hub: HubFirmware, events: list[bytes]) -> None:
        upload(hub, compiled("from pybricks.pupdevices import Motor\nMotor('C')"))
        hub.command(bytes([Command.START]))
        await ended(hub)
        assert "OSError: [Errno 19] ENODEV" in printed(events)

    with_hub(test)


def test_motors_stop_with_the_program() -> None:
    source = "from pybricks.pupdevices import Motor\nfrom pybricks.tools import wait\n"
    source += "m = Motor('A')\nm.hold()\nprint(m.angle())\nwait(60000)"

    async def test(hub: HubFirmware, events: list[bytes]) -> None:
        upload(hub, compiled(source))
        hub.command(bytes([Command.START]))
        while not printed(events).endswith("\n"):  # what is printed may come in pieces
            await asyncio.sleep(0.01)
        assert printed(events) == "30\r\n"
        assert hub.motors["A"].powered
        assert hub.command(bytes([Command.STOP])) is Answer.OK
        assert not hub.motors["A"].powered
        assert "SystemExit" in printed(events)
        assert statuses(events) == [True, False]

    with_hub(test)


def test_what_the_firmware_refuses() -> None:
    async def test(hub: HubFirmware, events: list[bytes]) -> None:
        assert hub.command(b"") is Answer.INVALID
        assert hub.command(b"\x63") is Answer.INVALID
        assert hub.command(bytes([Command.START])) is Answer.NOT_ALLOWED  # no program yet
        assert hub.command(struct.pack("<BI", Command.WRITE_META, MAX_PROGRAM_SIZE + 1)) is Answer.NOT_ALLOWED
        beyond = struct.pack("<BI", Command.WRITE_RAM, MAX_PROGRAM_SIZE - 1) + b"xx"
        assert hub.command(beyond) is Answer.NOT_ALLOWED
        assert hub.command(bytes([Command.WRITE_STDIN]) + bytes(600)) is Answer.BUSY
        upload(hub, compiled("from pybricks.tools import wait\nwait(60000)"))
        assert hub.command(bytes([Command.START])) is Answer.OK
        for command in (
            bytes([Command.START]),
            struct.pack("<BI", Command.WRITE_META, 0),
            struct.pack("<BI", Command.WRITE_RAM, 0) + b"x",
        ):
            assert hub.command(command) is Answer.BUSY

    with_hub(test)


@pytest.mark.parametrize(
    ("blob", "words"),
    [
        (b"\x01\0", "ends within a length"),
        (struct.pack("<I", 50) + b"__main__\0M\x06", "ends within a module"),
        (pack(b"M\x05\0\x1f"), "incompatible .mpy file"),
        (pack(b"M\x06\0\x3f"), "incompatible .mpy file"),
        (pack(b"M\x06\0\x1f").replace(b"__main__", b"helpers_"), "no module named '__main__'"),
    ],
)
def test_a_broken_upload_does_not_run(blob: bytes, words: str) -> None:
    with pytest.raises(ProgramError, match=words):
        unpack(blob)

    async def test(hub: HubFirmware, events: list[bytes]) -> None:
        upload(hub, blob)
        hub.command(bytes([Command.START]))
        await ended(hub)
        assert words in printed(events)
        assert statuses(events) == [False]

    with_hub(test)


def test_bytes_that_were_never_written_are_noticed() -> None:
    async def test(hub: HubFirmware, events: list[bytes]) -> None:
        hub.command(struct.pack("<BI", Command.WRITE_META, 0))
        hub.command(struct.pack("<BI", Command.WRITE_RAM, 0) + b"abc")
        hub.command(struct.pack("<BI", Command.WRITE_META, 10))
        assert [entry["holes"] for entry in hub.log.since(0, ["upload"])] == [7]

    with_hub(test)


def test_the_program_of_somebody_else_is_what_its_source_compiles_to() -> None:
    source = OTHER_PROGRAM.with_suffix(".py").read_text(encoding="utf-8")
    _, code = mpy_cross_compile("other_program.py", source, small_number_bits=31)
    assert OTHER_PROGRAM.read_bytes() == code


def test_a_motor_counts_turns_from_the_moment_a_program_takes_it() -> None:
    motor = EmulatedMotor(725.0)
    assert motor.state()[0] == 725
    motor.take()
    assert motor.state()[0] == 5
    assert motor.absolute_deg == pytest.approx(5)


def test_without_micropython_the_message_says_what_to_install(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(NoMicroPythonError, match=r"\./run --with 'emulator\[spike\]'"):
        micropython_command()


@pytest.mark.parametrize("name", hostile.NAMES.values(), ids=hostile.NAMES)
def test_a_module_is_written_into_its_folder_alone(tmp_path: Path, name: str) -> None:
    with pytest.raises(ProgramError, match="the name of a module cannot be a file name"):
        write_modules({name: b"M"}, tmp_path / "modules")
    assert list(tmp_path.iterdir()) == []
