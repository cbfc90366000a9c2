"""Bluetooth adapters: the system's, through bleak, or one driven by bumble."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from bleak.exc import BleakBluetoothNotAvailableError, BleakBluetoothNotAvailableReason, BleakDBusError

from joshua_spike.errors import AdapterUnusable

if TYPE_CHECKING:
    from joshua_spike.bumble_backend import BumbleAdapter

_REASONS = {
    BleakBluetoothNotAvailableReason.NO_BLUETOOTH: (
        "this machine has no working Bluetooth adapter",
        "plug one in; run bluetoothctl list to see the adapters",
    ),
    BleakBluetoothNotAvailableReason.POWERED_OFF: (
        "Bluetooth is switched off",
        "switch it on: bluetoothctl power on, and rfkill unblock bluetooth if it is blocked",
    ),
}
_REASONS.update(
    dict.fromkeys(
        (
            BleakBluetoothNotAvailableReason.DENIED_BY_USER,
            BleakBluetoothNotAvailableReason.DENIED_BY_SYSTEM,
            BleakBluetoothNotAvailableReason.DENIED_BY_UNKNOWN,
        ),
        (
            "the system does not permit this program to use Bluetooth",
            "allow it in the system's privacy settings, or join the group bluetooth",
        ),
    )
)
_NO_BLUEZ = (
    "the system's Bluetooth service (BlueZ, by D-Bus) is not running",
    "start it: systemctl start bluetooth; in a container, share the host's D-Bus socket",
)
_DBUS_ABSENT = ("ServiceUnknown", "NameHasNoOwner", "UnknownObject", "NoReply", "Disconnected")


@dataclass
class Adapter:
    """Parameters of bleak's scanner and client.

    Attributes:
        name: for messages.
        scanner_options, client_options: keyword arguments.
    """

    name: str
    scanner_options: dict[str, Any] = field(default_factory=dict)
    client_options: dict[str, Any] = field(default_factory=dict)
    bumble: BumbleAdapter | None = None

    async def close(self) -> None:
        """Close the adapter."""
        if self.bumble is not None:
            await self.bumble.close()


async def open_adapter(spec: str) -> Adapter:
    """Open the adapter that ``BLE.adapter`` names. Raises AdapterUnusable."""
    if ":" not in spec:
        options = {"bluez": {"adapter": spec}} if spec else {}
        return Adapter(f"adapter {spec}" if spec else "the default adapter", options, dict(options))
    try:
        from joshua_spike.bumble_backend import BumbleAdapter
    except ModuleNotFoundError as error:
        if error.name is None or error.name.partition(".")[0] != "bumble":
            raise
        from joshua.tools import install

        raise AdapterUnusable(
            f"adapter {spec}: bumble, which drives such adapters, is not installed: "
            f"{install('joshua-spike', 'bumble')}, or omit adapter to use the system's own"
        ) from error
    try:
        bumble = await BumbleAdapter.open(spec)
    except Exception as error:  # each transport raises the exceptions of its own library
        raise AdapterUnusable(
            f"adapter {spec}: cannot be opened: {error or type(error).__name__}. Check the address and that "
            "the transport behind it is running, or omit adapter to use the system's own"
        ) from error
    return Adapter(
        f"adapter {spec}", {"backend": bumble.scanner_type()}, {"backend": bumble.client_type()}, bumble
    )


def adapter_problem(adapter: str, error: Exception) -> AdapterUnusable | None:
    """Return the adapter problem behind a bleak error; None if the adapter is not the cause."""
    cause: tuple[str, str] | None = None
    if isinstance(error, BleakBluetoothNotAvailableError):
        cause = _REASONS.get(error.reason, (str(error.args[0]), "run bluetoothctl show"))
    elif isinstance(error, BleakDBusError):
        name = str(error.dbus_error)
        if name.endswith(_DBUS_ABSENT):
            cause = _NO_BLUEZ
        elif name.endswith(("NotReady", "NotPowered")):
            cause = _REASONS[BleakBluetoothNotAvailableReason.POWERED_OFF]
        elif name.endswith(("AccessDenied", "NotPermitted", "NotAuthorized")):
            cause = _REASONS[BleakBluetoothNotAvailableReason.DENIED_BY_SYSTEM]
    elif isinstance(error, OSError):  # the socket of the system bus is missing
        cause = _NO_BLUEZ
    elif "adapter" in str(error).lower() and "not" in str(error).lower():
        cause = _REASONS[BleakBluetoothNotAvailableReason.NO_BLUETOOTH]
    if cause is None:
        return None
    return AdapterUnusable(f"{adapter}: {cause[0]} ({error or type(error).__name__}); {cause[1]}")
