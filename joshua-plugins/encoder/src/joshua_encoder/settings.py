"""Settings of rotary encoders at one serial link."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any

from google.protobuf.message import Message
from joshua.api import BlockContext, FieldError, FromField
from joshua_serial.settings import SerialSettings
from pydantic import model_validator
from typing_extensions import Self

LINE, AS5600, AMT21 = "line", "as5600", "amt21"

#: Factory address of an AMT21.
USUAL_ADDRESS = 0x54

AS5600_RESOLUTION = 4096
AMT21_RESOLUTIONS = (16384, 4096)

#: Polling rate if the node does not set one.
USUAL_RATE_HZ = 100.0


class EncoderSettings(SerialSettings):
    """Settings of rotary encoders.

    Attributes:
        resolution: counts per revolution.
        inverted: count in the opposite direction.
        protocol: line, as5600 or amt21.
        joint_names: one for each encoder; addresses: of AMT21 encoders, empty for other protocols.
        counter_range: number of counts after which the counter wraps; 0: never.
        rate_hz: polling rate of encoders that are polled: the rate of the node's fastest publisher.
    """

    resolution: int
    inverted: bool = False
    protocol: str = LINE
    joint_names: Annotated[tuple[str, ...], FromField("joint_name")] = ()
    addresses: Annotated[tuple[int, ...], FromField("address")] = ()
    counter_range: int = 0
    rate_hz: float = USUAL_RATE_HZ

    @classmethod
    def called(cls) -> str:
        """Name of the device in messages."""
        return "an encoder"

    @classmethod
    def si_values(
        cls, values: Mapping[str, Any], node: Message | None, context: BlockContext
    ) -> dict[str, Any]:
        """Add the default addresses and names, and the rate."""
        result = super().si_values(values, node, context)
        rates = [publisher.publish_rate_hz for publisher in getattr(node, "publishers", ())]
        result["rate_hz"] = max((rate for rate in rates if rate > 0), default=USUAL_RATE_HZ)
        if result["protocol"] == AMT21 and not result["addresses"]:
            result["addresses"] = [USUAL_ADDRESS]
        if not result["joint_names"]:
            count = len(result["addresses"]) if result["protocol"] == AMT21 else 1
            result["joint_names"] = [f"joint_{number + 1}" for number in range(count)]
        return result

    @model_validator(mode="after")
    def _suits_the_protocol(self) -> Self:
        if self.protocol == AS5600 and self.resolution != AS5600_RESOLUTION:
            raise FieldError(
                "resolution",
                f"an AS5600 has {AS5600_RESOLUTION} counts in a revolution",
                allowed=(str(AS5600_RESOLUTION),),
                remedy=f"set resolution: {AS5600_RESOLUTION}, or correct protocol",
            )
        if self.protocol == AMT21 and self.resolution not in AMT21_RESOLUTIONS:
            near = sorted(AMT21_RESOLUTIONS, key=lambda counts: abs(counts - self.resolution))
            raise FieldError(
                "resolution",
                "an AMT21 has 16384 (14 bits) or 4096 (12 bits) counts in a revolution",
                allowed=tuple(str(counts) for counts in near),
                remedy="set the resolution that the encoder's label says",
            )
        if self.protocol != LINE and self.counter_range:
            raise FieldError(
                "counter_range",
                f'the protocol "{self.protocol}" counts one revolution; counter_range would have no effect',
                allowed=("omitted",),
                remedy="remove counter_range",
            )
        if self.counter_range == 1:
            raise FieldError(
                "counter_range",
                "a counter needs at least two counts",
                allowed=("0", "65536", "4294967296"),
                remedy="set the number of counts, such as 65536 for 16 bits",
            )
        if self.protocol != AMT21 and self.addresses:
            raise FieldError(
                "address",
                f'the protocol "{self.protocol}" has no addresses; address would have no effect',
                allowed=("omitted",),
                remedy='remove address, or set protocol: "amt21"',
            )
        return self

    @model_validator(mode="after")
    def _tells_encoders_apart(self) -> Self:
        for index, address in enumerate(self.addresses):
            if address % 4:
                below = address - address % 4
                raise FieldError(
                    f"address[{index}]",
                    "the lowest two bits of an AMT21's address are 0",
                    allowed=(str(below), str(below + 4)) if below < 252 else (str(below),),
                    remedy="set the address that the encoder was given, a multiple of 4",
                )
            if address in self.addresses[:index]:
                raise FieldError(
                    f"address[{index}]",
                    f"two encoders have the address {address}",
                    remedy="give each encoder on the bus an address of its own",
                )
        encoders = max(1, len(self.addresses))
        if len(self.joint_names) != encoders:
            raise FieldError(
                "joint_name",
                f"{len(self.joint_names)} names are given for {encoders} encoders",
                allowed=(f"{encoders} names",),
                remedy="name each encoder once, in the order of address, or omit all names",
            )
        for index, name in enumerate(self.joint_names):
            if not name or name in self.joint_names[:index]:
                raise FieldError(
                    f"joint_name[{index}]",
                    "a joint has an empty name" if not name else f"two encoders are called {name}",
                    remedy="give each encoder a name of its own",
                )
        return self
