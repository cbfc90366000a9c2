"""Bleak back end on bumble, for adapters with HCI over TCP, a serial port, USB and so on."""

from __future__ import annotations

import asyncio
import contextlib
import logging
from collections.abc import Awaitable, Callable
from typing import Any, ClassVar, TypeVar

from bleak.args import SizedBuffer
from bleak.backends.characteristic import BleakGATTCharacteristic
from bleak.backends.client import BaseBleakClient
from bleak.backends.descriptor import BleakGATTDescriptor
from bleak.backends.device import BLEDevice
from bleak.backends.scanner import AdvertisementData, BaseBleakScanner
from bleak.backends.service import BleakGATTService, BleakGATTServiceCollection
from bleak.exc import BleakError, BleakGATTProtocolError
from bleak.uuids import normalize_uuid_str
from bumble import core, gatt, hci
from bumble.att import ATT_Error
from bumble.core import AdvertisingData
from bumble.device import Advertisement, Connection, Device, Peer
from bumble.transport import open_transport
from bumble.transport.common import Transport

OPEN_TIMEOUT_S = 5.0
DISCONNECT_TIMEOUT_S = 2.0
WANTED_MTU = 517
_PROPERTIES = {
    gatt.Characteristic.Properties.READ: "read",
    gatt.Characteristic.Properties.WRITE: "write",
    gatt.Characteristic.Properties.WRITE_WITHOUT_RESPONSE: "write-without-response",
    gatt.Characteristic.Properties.NOTIFY: "notify",
    gatt.Characteristic.Properties.INDICATE: "indicate",
}
_UUID_LISTS = (
    AdvertisingData.Type.COMPLETE_LIST_OF_16_BIT_SERVICE_CLASS_UUIDS,
    AdvertisingData.Type.INCOMPLETE_LIST_OF_16_BIT_SERVICE_CLASS_UUIDS,
    AdvertisingData.Type.COMPLETE_LIST_OF_128_BIT_SERVICE_CLASS_UUIDS,
    AdvertisingData.Type.INCOMPLETE_LIST_OF_128_BIT_SERVICE_CLASS_UUIDS,
)
_NAMES = (AdvertisingData.Type.COMPLETE_LOCAL_NAME, AdvertisingData.Type.SHORTENED_LOCAL_NAME)

T = TypeVar("T")


class BumbleAdapter:
    """One adapter, powered on between ``open`` and ``close``."""

    def __init__(self, transport: Transport, device: Device) -> None:
        self._transport = transport
        self.device = device

    @classmethod
    async def open(cls, spec: str) -> BumbleAdapter:
        """Open a transport such as ``tcp-client:127.0.0.1:4711``. Raises OSError, BleakError."""
        logging.getLogger("bumble").setLevel(logging.WARNING)  # otherwise each packet logs several lines
        transport = await open_transport(spec)
        try:
            device = Device.with_hci(
                "joshua", hci.Address.generate_static_address(), transport.source, transport.sink
            )
            await asyncio.wait_for(device.power_on(), OPEN_TIMEOUT_S)
        except BaseException as error:
            await transport.close()
            if isinstance(error, (asyncio.TimeoutError, core.BaseBumbleError, hci.HCI_Error)):
                raise BleakError(f"the adapter does not answer ({type(error).__name__})") from error
            raise
        return cls(transport, device)

    async def close(self) -> None:
        """Switch the adapter off."""
        for connection in list(self.device.connections.values()):
            with contextlib.suppress(Exception):
                await asyncio.wait_for(connection.disconnect(), DISCONNECT_TIMEOUT_S)
        await self._transport.close()

    def scanner_type(self) -> type[BaseBleakScanner]:
        """Return the ``backend`` of ``BleakScanner``."""
        return type("BumbleScannerOfAdapter", (BumbleScanner,), {"device": self.device})

    def client_type(self) -> type[BaseBleakClient]:
        """Return the ``backend`` of ``BleakClient``."""
        return type("BumbleClientOfAdapter", (BumbleClient,), {"device": self.device})


class BumbleScanner(BaseBleakScanner):
    """Listens for advertisements."""

    device: ClassVar[Device]

    def __init__(
        self, detection_callback: Any, service_uuids: list[str] | None, scanning_mode: str, **_: Any
    ) -> None:
        super().__init__(detection_callback, service_uuids)
        self._active = scanning_mode == "active"

    async def start(self) -> None:
        """Start scanning."""
        self.seen_devices = {}
        self.device.on(Device.EVENT_ADVERTISEMENT, self._on_advertisement)
        await _translated(self.device.start_scanning(active=self._active))

    async def stop(self) -> None:
        """Stop scanning."""
        self.device.remove_listener(Device.EVENT_ADVERTISEMENT, self._on_advertisement)
        await _translated(self.device.stop_scanning())

    def _on_advertisement(self, advertisement: Advertisement) -> None:
        data = advertisement.data
        name = next((str(name) for kind in _NAMES if (name := data.get(kind)) is not None), None)
        uuids = [
            _uuid(uuid) for kind in _UUID_LISTS for found in data.get_all(kind) for uuid in _uuids(found)
        ]
        if not self.is_allowed_uuid(uuids):
            return
        address = str(advertisement.address)
        found = AdvertisementData(name, {}, {}, uuids, None, advertisement.rssi, (advertisement,))
        device = self.create_or_update_device(address, address, name, advertisement, found)
        self.call_detection_callbacks(device, found)


class BumbleClient(BaseBleakClient):
    """A connection to one peripheral."""

    device: ClassVar[Device]

    def __init__(self, address_or_ble_device: BLEDevice | str, **kwargs: Any) -> None:
        callback, timeout = kwargs["disconnected_callback"], kwargs["timeout"]
        super().__init__(address_or_ble_device, disconnected_callback=callback, timeout=timeout)
        name = address_or_ble_device.name if isinstance(address_or_ble_device, BLEDevice) else None
        self._name = name or self.address
        self._connection: Connection | None = None
        self._peer: Peer | None = None
        self._subscribers: dict[int, Callable[[bytes], None]] = {}

    @property
    def name(self) -> str:
        """Name of the peripheral."""
        return self._name

    @property
    def mtu_size(self) -> int:
        """Negotiated size of an attribute packet."""
        return self._open_peer().gatt_client.mtu

    @property
    def is_connected(self) -> bool:
        """Whether the link is connected."""
        return self._connection is not None

    async def connect(self, pair: bool, **_: Any) -> None:
        """Connect and discover the services. Raises BleakError."""
        if pair:
            raise BleakError("this back end does not pair")
        connection = await _translated(self.device.connect(hci.Address(self.address), timeout=self._timeout))
        if connection.handle not in self.device.connections:
            raise BleakError("the link was lost at once")
        self._connection = connection
        connection.on(Connection.EVENT_DISCONNECTION, self._on_disconnection)
        self._peer = Peer(connection)
        try:
            await _translated(self._peer.request_mtu(WANTED_MTU))
            await _translated(self._discover(self._peer))
        except BaseException:
            await self.disconnect()
            raise

    async def disconnect(self) -> None:
        """End the link. Idempotent."""
        if self._connection is not None:
            with contextlib.suppress(BleakError):
                await _translated(asyncio.wait_for(self._connection.disconnect(), DISCONNECT_TIMEOUT_S))
        self._connection = self._peer = self.services = None

    async def pair(self, *_: Any, **__: Any) -> None:
        """Raise: a hub needs no pairing."""
        raise BleakError("this back end does not pair")

    async def unpair(self) -> None:
        """Raise: a hub needs no pairing."""
        raise BleakError("this back end does not pair")

    async def read_gatt_char(
        self, characteristic: BleakGATTCharacteristic, *, use_cached: bool = False, **_: Any
    ) -> bytearray:
        """Read a value."""
        del use_cached
        return bytearray(await _translated(self._open_peer().read_value(characteristic.obj)))

    async def write_gatt_char(
        self, characteristic: BleakGATTCharacteristic, data: SizedBuffer, response: bool
    ) -> None:
        """Write a value."""
        peer = self._open_peer()
        await _translated(peer.write_value(characteristic.obj, bytes(data), with_response=response))

    async def start_notify(
        self, characteristic: BleakGATTCharacteristic, callback: Callable[[bytearray], None], **_: Any
    ) -> None:
        """Subscribe to notifications."""

        def on_value(value: bytes) -> None:
            callback(bytearray(value))

        self._subscribers[characteristic.handle] = on_value
        await _translated(self._open_peer().subscribe(characteristic.obj, on_value))

    async def stop_notify(self, characteristic: BleakGATTCharacteristic) -> None:
        """End the subscription."""
        subscriber = self._subscribers.pop(characteristic.handle, None)
        await _translated(self._open_peer().unsubscribe(characteristic.obj, subscriber))

    async def read_gatt_descriptor(
        self, descriptor: BleakGATTDescriptor, *, use_cached: bool = False, **_: Any
    ) -> bytearray:
        """Read a descriptor."""
        del use_cached
        return bytearray(await _translated(self._open_peer().read_value(descriptor.obj)))

    async def write_gatt_descriptor(self, descriptor: BleakGATTDescriptor, data: SizedBuffer) -> None:
        """Write a descriptor."""
        await _translated(self._open_peer().write_value(descriptor.obj, bytes(data), with_response=True))

    def _open_peer(self) -> Peer:
        if self._peer is None:
            raise BleakError("the link is closed")
        return self._peer

    async def _discover(self, peer: Peer) -> None:
        services = BleakGATTServiceCollection()
        for service in await peer.discover_services():
            found = BleakGATTService(service, service.handle, _uuid(service.uuid))
            services.add_service(found)
            for characteristic in await peer.discover_characteristics(service=service):
                properties: Any = [
                    name for flag, name in _PROPERTIES.items() if flag & characteristic.properties
                ]
                services.add_characteristic(
                    BleakGATTCharacteristic(
                        characteristic,
                        characteristic.handle,
                        _uuid(characteristic.uuid),
                        properties,
                        lambda: peer.gatt_client.mtu - 3,
                        found,
                    )
                )
        self.services = services

    def _on_disconnection(self, _: int) -> None:
        self._connection = self._peer = None
        if self._disconnected_callback is not None:
            self._disconnected_callback()


async def _translated(awaitable: Awaitable[T]) -> T:
    """Await, and convert errors to those of bleak's own back ends."""
    try:
        return await awaitable
    except ATT_Error as error:
        raise BleakGATTProtocolError(error.error_code) from error
    except asyncio.CancelledError as error:
        task = asyncio.current_task()
        if task is not None and getattr(task, "cancelling", lambda: 0)():
            raise
        raise BleakError("the link was lost") from error  # bumble cancels pending requests
    except (core.BaseBumbleError, hci.HCI_Error, asyncio.TimeoutError) as error:
        raise BleakError(f"{type(error).__name__}: {error}") from error


def _uuid(uuid: core.UUID) -> str:
    return normalize_uuid_str(uuid.to_hex_str("-").lower())


def _uuids(found: Any) -> list[core.UUID]:
    return list(found) if isinstance(found, (list, tuple)) else [found]
