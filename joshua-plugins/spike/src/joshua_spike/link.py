"""The link to one hub: discovery, connection, program start and output."""

from __future__ import annotations

import asyncio
import contextlib
import difflib
from collections import deque
from collections.abc import Callable

from bleak import BleakClient, BleakScanner
from bleak.backends.device import BLEDevice
from bleak.backends.scanner import AdvertisementData
from bleak.exc import BleakError
from joshua.api.patience import AwakeClock

from joshua_spike.adapters import Adapter, adapter_problem, open_adapter
from joshua_spike.errors import HubNotFound, HubUnreachable, LinkLost, ProgramFailed, WrongFirmware
from joshua_spike.lines import Line, LineReader
from joshua_spike.pybricks import (
    CAPABILITIES,
    COMMAND_EVENT,
    MPY6_PROGRAMS,
    REFUSALS,
    Capabilities,
    Command,
    Event,
    Status,
    stdin_commands,
    upload_commands,
)
from joshua_spike.waiting import LOOK_S, wait_awake

FIND_TIMEOUT_S = 8.0
CONNECT_TIMEOUT_S = 15.0
CONNECT_ATTEMPTS = 3
FIRST_BACK_OFF_S = 0.5
COMMAND_TIMEOUT_S = 5.0
LAST_WORDS = 12  # number of output lines in a message


class HubLink:
    """A link to one hub. Call all methods on one event loop.

    Args:
        device_name: under which the hub advertises; service: of the hub.
        adapter: value of ``BLE.adapter``.
        on_line: receives the lines of the hub program; on_end: receives the reason when the program or the
            link ends.
    """

    def __init__(
        self,
        device_name: str,
        service: str,
        adapter: str,
        on_line: Callable[[Line], None],
        on_end: Callable[[Exception], None],
    ) -> None:
        self.device_name = device_name
        self._service = service.lower()
        self._adapter_spec = adapter
        self._on_line = on_line
        self._on_end = on_end
        self._adapter: Adapter | None = None
        self._client: BleakClient | None = None
        self._capabilities = Capabilities(20, 0, 0)
        self._status: Status | None = None
        self._status_changed = asyncio.Event()
        self._expects_program = False
        self._stands = False
        self._output: deque[str] = deque(maxlen=LAST_WORDS)
        self.reader = LineReader()
        self.address = ""

    def __str__(self) -> str:
        return f"hub {self.device_name!r}" + (f" ({self.address})" if self.address else "")

    @property
    def status(self) -> Status:
        """Last status of the hub."""
        return self._status or Status(0)

    @property
    def max_write_size(self) -> int:
        """Largest command, in bytes."""
        return self._capabilities.max_write_size

    async def open(self) -> None:
        """Find the hub, connect and check its firmware.

        Raises:
            AdapterUnusable, HubNotFound, HubUnreachable, WrongFirmware: by cause.
        """
        self._adapter = await open_adapter(self._adapter_spec)
        delay_s = FIRST_BACK_OFF_S
        for attempt in range(1, CONNECT_ATTEMPTS + 1):
            device = await self._find()
            self.address = device.address
            try:
                await self._connect(device)
                return
            except (BleakError, OSError, asyncio.TimeoutError) as error:
                await self._drop()
                if problem := adapter_problem(self._adapter.name, error):
                    raise problem from error
                if attempt == CONNECT_ATTEMPTS:
                    raise HubUnreachable(
                        f"{self}: was found, but {attempt} attempts to connect failed: "
                        f"{error or type(error).__name__}. Move closer, make sure that no other program "
                        "such as Pybricks Code is connected to it, or switch the hub off and on"
                    ) from error
            await asyncio.sleep(delay_s)
            delay_s *= 2

    async def close(self) -> None:
        """End the link. Idempotent. The program on the hub continues."""
        self._expects_program = False
        await self._drop()
        adapter, self._adapter = self._adapter, None
        if adapter is not None:
            await adapter.close()

    async def command(self, data: bytes) -> None:
        """Send one command and wait for the hub's reply. Raises LinkLost, ProgramFailed."""
        await self._write(data, response=True)

    async def say(self, line: Line) -> None:
        """Send a line to the program, without waiting. Raises LinkLost."""
        for command in stdin_commands(line.encode(), self.max_write_size):
            await self._write(command, response=False)

    async def upload(self, blob: bytes) -> None:
        """Stop the running program, upload another and start it. Raises LinkLost, ProgramFailed."""
        limit = self._capabilities.max_program_size
        if limit and len(blob) > limit:
            raise ProgramFailed(
                f"{self}: accepts programs of at most {limit} bytes, and the program of "
                f"JOSHUA has {len(blob)}"
            )
        self._expects_program = False
        await self.command(bytes([Command.STOP_PROGRAM]))
        await self._wait_for_program(False)
        self.reader.clear()
        self._output.clear()
        for command in upload_commands(blob, self.max_write_size):
            await self.command(command)
        await self._wait_for_program(True)

    def guard_program(self) -> None:
        """Treat the end of the program as a fault from now on."""
        self._expects_program = True
        if not self.status & Status.PROGRAM_RUNNING:
            self._ended(self._program_failed("has ended"))

    async def first_status(self) -> Status:
        """Return the status that the hub sends to a new listener. Raises LinkLost."""
        await self._wait_until(lambda: self._status is not None)
        return self.status

    def last_words(self) -> str:
        """Return the last output of the program other than its lines, for messages."""
        return "\n  ".join(self._output)

    async def _find(self) -> BLEDevice:
        assert self._adapter is not None
        heard: dict[str, str] = {}

        def is_ours(device: BLEDevice, advertisement: AdvertisementData) -> bool:
            name = advertisement.local_name or device.name or ""
            if name:
                heard[device.address] = name
            return name == self.device_name

        try:
            device = await BleakScanner.find_device_by_filter(
                is_ours, timeout=FIND_TIMEOUT_S, **self._adapter.scanner_options
            )
        except (BleakError, OSError) as error:
            problem = adapter_problem(self._adapter.name, error)
            raise problem or HubUnreachable(
                f"{self}: {self._adapter.name} cannot search for it: {error or type(error).__name__}"
            ) from error
        if device is None:
            raise HubNotFound(self._not_found(list(heard.values())))
        return device

    def _not_found(self, heard: list[str]) -> str:
        near = difflib.get_close_matches(self.device_name, heard, n=1)
        names = ", ".join(repr(name) for name in sorted(set(heard))) or "nothing"
        text = f"{self}: not found within {FIND_TIMEOUT_S:g} s; found: {names}. "
        if near:
            return text + f"Write device_name: {near[0]!r}, if that is the hub"
        return text + (
            "Switch the hub on and move it closer; a hub that is connected elsewhere, such as to Pybricks "
            "Code in a browser or to another run, does not advertise: disconnect it there"
        )

    async def _connect(self, device: BLEDevice) -> None:
        assert self._adapter is not None
        self._status = None
        client = BleakClient(
            device,
            disconnected_callback=self._on_disconnected,
            timeout=CONNECT_TIMEOUT_S,
            **self._adapter.client_options,
        )
        await wait_awake(client.connect(), CONNECT_TIMEOUT_S)
        self._client = client
        if client.services.get_service(self._service) is None:
            found = ", ".join(service.description for service in client.services)
            await self._drop()
            raise WrongFirmware(
                f"{self}: offers no Pybricks service, so it runs LEGO's firmware or is another device. Its "
                f"services: {found}. Install Pybricks at https://code.pybricks.com (it can be undone), or "
                "correct device_name"
            )
        try:
            self._capabilities = Capabilities.parse(bytes(await client.read_gatt_char(CAPABILITIES)))
        except (BleakError, ValueError):
            self._capabilities = Capabilities(0, 0, 0)
        if not self._capabilities.features & MPY6_PROGRAMS:
            await self._drop()
            raise WrongFirmware(
                f"{self}: runs a Pybricks version without support for .mpy version 6; update it to 3.3 "
                "or newer at https://code.pybricks.com"
            )
        await client.start_notify(COMMAND_EVENT, lambda _, data: self._on_event(bytes(data)))
        self._stands = True

    async def _drop(self) -> None:
        client, self._client = self._client, None
        self._stands = False
        if client is not None:
            with contextlib.suppress(BleakError, OSError, asyncio.TimeoutError):
                await wait_awake(client.disconnect(), COMMAND_TIMEOUT_S)

    async def _write(self, data: bytes, *, response: bool) -> None:
        client = self._client
        if client is None:
            raise LinkLost(f"{self}: the link is closed")
        try:
            await wait_awake(
                client.write_gatt_char(COMMAND_EVENT, data, response=response), COMMAND_TIMEOUT_S
            )
        except (BleakError, OSError, asyncio.TimeoutError) as error:
            code = error.args[0] if error.args and isinstance(error.args[0], int) else None
            if code in REFUSALS:
                raise ProgramFailed(
                    f"{self}: refuses command {data[0]}: {REFUSALS[code]}. Switch the hub off and on"
                ) from error
            raise LinkLost(f"{self}: the link was lost ({error or type(error).__name__})") from error

    async def _wait_for_program(self, running: bool) -> None:
        try:
            await self._wait_until(lambda: bool(self.status & Status.PROGRAM_RUNNING) is running)
        except LinkLost:
            if self._client is None or not running:
                raise
            raise self._program_failed("does not start") from None

    async def _wait_until(self, reached: Callable[[], bool]) -> None:
        clock = AwakeClock()
        while not reached():
            left_s = COMMAND_TIMEOUT_S - clock.now_s()
            if self._client is None or left_s <= 0:
                raise LinkLost(f"{self}: does not report its status. Move closer")
            self._status_changed.clear()
            with contextlib.suppress(asyncio.TimeoutError):
                await asyncio.wait_for(self._status_changed.wait(), min(left_s, LOOK_S))

    def _on_event(self, data: bytes) -> None:
        if not data:
            return
        if data[0] == Event.STATUS and len(data) >= 5:
            self._status = Status(int.from_bytes(data[1:5], "little"))
            self._status_changed.set()
            if self._expects_program and not self._status & Status.PROGRAM_RUNNING:
                self._expects_program = False
                # output may arrive after this event, because the firmware queues them separately
                asyncio.get_running_loop().call_later(
                    0.05, lambda: self._ended(self._program_failed("has ended"))
                )
        elif data[0] == Event.STDOUT:
            for line in self.reader.feed(data[1:]):
                if isinstance(line, Line):
                    self._on_line(line)
                else:
                    self._output.append(line)

    def _program_failed(self, what: str) -> ProgramFailed:
        words = self.last_words()
        said = f". Its output:\n  {words}" if words else " without output"
        return ProgramFailed(
            f"{self}: the program on the hub {what}{said}\n"
            "  The motors' torque is off. The hub's button may have been pressed, or a motor unplugged. "
            "Check both, then start again"
        )

    def _on_disconnected(self, client: BleakClient) -> None:
        if client is not self._client:
            return  # closed by this side
        self._client = None
        self._status_changed.set()
        if not self._stands:
            return  # the connection attempt fails and is repeated
        self._stands = False
        self._ended(
            LinkLost(
                f"{self}: the link was lost: the hub was switched off, is out of range, or its battery is "
                "empty. Its dead man's switch has stopped the motors"
            )
        )

    def _ended(self, reason: Exception) -> None:
        self._expects_program = False
        self._on_end(reason)
