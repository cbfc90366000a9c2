"""The radio of an emulated hub: Pybricks' GATT services on a virtual controller, and adapters over TCP.

Each connection to the TCP port is a separate Bluetooth adapter with HCI, in range of the hub.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import socket
import time
from collections import deque
from collections.abc import Callable
from functools import partial
from typing import Any
from zlib import crc32

from bumble import hci, ll
from bumble.att import ATT_Error, AttributeValue
from bumble.controller import Controller
from bumble.core import UUID, AdvertisingData, PhysicalTransport
from bumble.device import Connection, Device
from bumble.gatt import Characteristic, Service
from bumble.host import Host
from bumble.link import LocalLink
from bumble.transport.common import AsyncPipeSink, PacketParser

from joshua_emulator.event_log import EventLog
from joshua_emulator.spike.hub import Answer, HubFirmware

PYBRICKS_SERVICE = "c5f50001-8280-46da-89f4-6d8051e4aeef"
COMMAND_EVENT = "c5f50002-8280-46da-89f4-6d8051e4aeef"
CAPABILITIES = "c5f50003-8280-46da-89f4-6d8051e4aeef"
DEVICE_INFORMATION = UUID.from_16_bits(0x180A)
FIRMWARE_REVISION = UUID.from_16_bits(0x2A26)
PROTOCOL_VERSION = UUID.from_16_bits(0x2A28)
LEGO_SERVICE = UUID.from_16_bits(0xFD02)
PYBRICKS_FIRMWARE, PYBRICKS_PROTOCOL = b"4.0.0", b"1.5.0"

ADVERTISING_INTERVAL_MS = 50.0
STATUS_PERIOD_S = 0.5
MTU = 158
REMOTE_TERMINATED, CONNECTION_TIMEOUT = 0x13, 0x08


class Air(LocalLink):
    """The air between controllers; with an interval, data waits for the next connection event."""

    def __init__(self) -> None:
        super().__init__()  # type: ignore[no-untyped-call]
        self.interval_s = 0.0
        self._waiting: deque[Callable[[], None]] = deque()

    def send_acl_data(
        self, sender_controller: Any, destination_address: Any, transport: PhysicalTransport, data: bytes
    ) -> None:
        """Hand data over, in order."""
        deliver = partial(super().send_acl_data, sender_controller, destination_address, transport, data)
        if not (self.interval_s or self._waiting):
            deliver()
            return
        loop = asyncio.get_running_loop()
        if not self._waiting:
            event_s = self.interval_s and (loop.time() // self.interval_s + 1) * self.interval_s
            loop.call_at(event_s, self._connection_event)
        self._waiting.append(deliver)

    def _connection_event(self) -> None:
        while self._waiting:
            self._waiting.popleft()()


class HciSink:
    """Sends a controller's packets to the host at the other end of a TCP connection."""

    def __init__(self, writer: asyncio.StreamWriter) -> None:
        self._writer = writer

    def on_packet(self, packet: bytes) -> None:
        """Send one packet."""
        if not self._writer.is_closing():
            self._writer.write(packet)


class Radio:
    """The hub's radio, and the virtual adapters of its hosts.

    Args:
        name: under which the hub advertises.
        hub: the firmware.
        listener: a bound socket on loopback for hosts of virtual adapters.
    """

    def __init__(self, name: str, hub: HubFirmware, listener: socket.socket, log: EventLog) -> None:
        self.name = name
        self.address = ":".join(
            f"{byte:02X}" for byte in b"\xf0\xaa" + crc32(name.encode()).to_bytes(4, "big")
        )
        self.hub = hub
        self.air = Air()
        self.firmware = "pybricks"  # or old, which knows no .mpy 6; or lego, with another service
        self.flaky = 0  # connections that are lost at once
        self._listener = listener
        self._log = log
        self._device: Device | None = None
        self._controller: Controller | None = None
        self._events: Any = None
        self._connection: Connection | None = None
        self._out_of_range = False
        self._adapters = 0
        self._server: asyncio.Server | None = None
        self._tasks: set[asyncio.Task[Any]] = set()
        self._subscribed = False

    async def start(self) -> None:
        """Switch the radio on and listen for hosts."""
        self._server = await asyncio.start_server(self._serve_adapter, sock=self._listener)
        await self._make_device()
        self._keep(self._report_status())

    async def go(self, *, near: bool) -> None:
        """Enter or leave radio range; the link is lost without notice."""
        self._out_of_range = not near
        assert self._device is not None
        if near:
            await self._advertise()
        else:
            await self._device.stop_advertising()
            self._cut(CONNECTION_TIMEOUT)

    async def set_firmware(self, firmware: str) -> None:
        """Change what the hub is."""
        self.firmware = firmware
        await self.go(near=False)
        await self._make_device()

    async def close(self) -> None:
        """Switch off."""
        for task in list(self._tasks):
            task.cancel()
        if self._server is not None:
            self._server.close()
        await asyncio.sleep(0)

    @property
    def connected(self) -> bool:
        """Whether a host is connected."""
        return self._connection is not None

    async def _make_device(self) -> None:
        if self._controller is not None:
            self.air.remove_controller(self._controller)
        self._out_of_range = False
        self._controller = Controller("hub", link=self.air, public_address=self.address)
        host = Host(self._controller, AsyncPipeSink(self._controller))
        device = Device(name=self.name, address=hci.Address(self.address), host=host)
        read, write, notify = (
            Characteristic.Properties.READ,
            Characteristic.Properties.WRITE,
            Characteristic.Properties.NOTIFY,
        )
        lego = self.firmware == "lego"
        if not lego:
            self._events = Characteristic(
                COMMAND_EVENT,
                write | Characteristic.Properties.WRITE_WITHOUT_RESPONSE | notify,
                Characteristic.WRITEABLE,
                AttributeValue(write=self._command),
            )
            capabilities = Characteristic(
                CAPABILITIES, read, Characteristic.READABLE, self.hub.capabilities(old=self.firmware == "old")
            )
            device.add_service(Service(PYBRICKS_SERVICE, [self._events, capabilities]))
            self._events.on(Characteristic.EVENT_SUBSCRIPTION, self._on_subscription)
            self.hub.send = self._send
        versions = [
            Characteristic(FIRMWARE_REVISION, read, Characteristic.READABLE, PYBRICKS_FIRMWARE),
            Characteristic(PROTOCOL_VERSION, read, Characteristic.READABLE, PYBRICKS_PROTOCOL),
        ]
        device.add_service(Service(DEVICE_INFORMATION, versions[lego:]))
        device.gatt_server.max_mtu = MTU
        device.on(Device.EVENT_CONNECTION, self._on_connection)
        await device.power_on()
        self._device = device
        await self._advertise()

    async def _advertise(self) -> None:
        assert self._device is not None
        if self._out_of_range or self.connected:
            return
        lego = self.firmware == "lego"
        service = LEGO_SERVICE if lego else UUID(PYBRICKS_SERVICE)
        kind = (
            AdvertisingData.COMPLETE_LIST_OF_16_BIT_SERVICE_CLASS_UUIDS
            if lego
            else AdvertisingData.COMPLETE_LIST_OF_128_BIT_SERVICE_CLASS_UUIDS
        )
        data = AdvertisingData(
            [(kind, service.to_bytes()), (AdvertisingData.COMPLETE_LOCAL_NAME, self.name.encode())]
        )
        await self._device.start_advertising(
            advertising_data=bytes(data),
            advertising_interval_min=ADVERTISING_INTERVAL_MS,
            advertising_interval_max=ADVERTISING_INTERVAL_MS,
        )

    def _on_connection(self, connection: Connection) -> None:
        self._connection = connection
        self._subscribed = False
        self.hub.connected = True
        self._log.add("connected", time.monotonic())
        connection.on(Connection.EVENT_DISCONNECTION, self._on_disconnection)
        if self.flaky > 0:
            self.flaky -= 1
            asyncio.get_running_loop().call_soon(self._cut, CONNECTION_TIMEOUT)

    def _on_disconnection(self, reason: int) -> None:
        self._connection = None
        self.hub.connected = self._subscribed = False
        self._log.add("disconnected", time.monotonic(), reason=reason)
        self._keep(self._advertise())

    def _on_subscription(self, _: Any, notify: bool, __: bool) -> None:
        self._subscribed = notify
        self._send(self.hub.status())

    def _command(self, _: Connection, value: bytes) -> None:
        answer = self.hub.command(bytes(value))
        if answer is not Answer.OK:
            raise ATT_Error(error_code=answer)

    def _send(self, event: bytes) -> None:
        if self._connection is None or self._device is None or not self._subscribed:
            return
        self._keep(self._device.notify_subscriber(self._connection, self._events, event))

    async def _report_status(self) -> None:
        while True:
            await asyncio.sleep(STATUS_PERIOD_S)
            if self.firmware != "lego":
                self._send(self.hub.status())

    def _cut(self, reason: int) -> None:
        """End the connection at both ends."""
        controller = self._controller
        assert controller is not None
        for connection in list(controller.le_connections.values()):
            with contextlib.suppress(Exception):  # the other end may be gone already
                connection.send_ll_control_pdu(ll.TerminateInd(reason))
            controller.on_le_disconnected(connection, reason)

    async def _serve_adapter(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        """One virtual adapter, from the connection of its host to its end."""
        connection_socket = writer.get_extra_info("socket")
        connection_socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)  # packets are small
        self._adapters += 1
        number = self._adapters & 0xFFFF
        address = f"F0:BB:00:00:{number >> 8:02X}:{number & 255:02X}"
        adapter = Controller(
            f"adapter {number}", host_sink=HciSink(writer), link=self.air, public_address=address
        )
        parser = PacketParser(adapter)
        with contextlib.suppress(OSError):
            while data := await reader.read(65536):
                parser.feed_data(data)
        self.air.remove_controller(adapter)
        for connection in list(adapter.le_connections.values()):
            if self._controller is not None:
                self._controller.on_ll_control_pdu(
                    connection.self_address, ll.TerminateInd(REMOTE_TERMINATED)
                )
        writer.close()

    def _keep(self, coroutine: Any) -> None:
        task = asyncio.ensure_future(coroutine)
        self._tasks.add(task)
        task.add_done_callback(self._done)

    def _done(self, task: asyncio.Task[Any]) -> None:
        self._tasks.discard(task)
        if not task.cancelled() and (error := task.exception()) is not None:
            logging.getLogger(__name__).warning("radio: %s", error)
