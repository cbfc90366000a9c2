"""The supported scanners as data, without numpy, for settings and messages."""

from __future__ import annotations

from dataclasses import dataclass

#: Scan modes of an RPLIDAR.
EXPRESS, STANDARD = "express", "standard"


@dataclass(frozen=True)
class Model:
    """One scanner.

    Attributes:
        name: as in ``LidarConfig.model``; title: display name.
        family: command set: rplidar, ydlidar, lds01, or none.
        baudrate: its fixed line speed.
        beams: per turn in the published scan, about as many as it measures; standard_beams: the same for an
            RPLIDAR's standard scan.
        turn_hz: nominal turns per second.
        power: required supply, for messages.
    """

    name: str
    title: str
    family: str
    baudrate: int
    beams: int
    turn_hz: float
    power: str
    standard_beams: int = 0

    @property
    def one(self) -> str:
        """The title with its article."""
        return f"a {self.title}" if self.title.startswith("Y") else f"an {self.title}"

    def beams_in(self, scan_mode: str) -> int:
        """Return the beams per turn in a scan mode."""
        return self.standard_beams if self.standard_beams and scan_mode == STANDARD else self.beams


_USB = "5 V from a USB socket that gives 500 mA"
_STRONG = "5 V with 500 mA while it starts to turn"

MODELS = {
    model.name: model
    for model in (
        Model("rplidar_a1", "RPLIDAR A1", "rplidar", 115_200, 720, 5.5, _USB, standard_beams=360),
        Model(
            "rplidar_c1", "RPLIDAR C1", "rplidar", 460_800, 500, 10.0, "5 V with 800 mA", standard_beams=500
        ),
        Model("ld06", "LD06", "none", 230_400, 450, 10.0, _USB),
        Model("ld19", "LD19", "none", 230_400, 450, 10.0, _USB),
        Model("lds01", "LDS-01", "lds01", 230_400, 360, 5.0, _STRONG),
        Model("ydlidar_x2", "YDLIDAR X2", "none", 115_200, 430, 7.0, _STRONG),
        Model("ydlidar_x4", "YDLIDAR X4", "ydlidar", 128_000, 720, 7.0, _STRONG),
    )
}

#: Model numbers that RPLIDARs and YDLIDARs report.
RPLIDAR_NUMBERS = {0x18: "rplidar_a1", 0x41: "rplidar_c1"}
YDLIDAR_NUMBERS = {6: "ydlidar_x4"}

#: Models with identical streams.
SAME_STREAM = ({"ld06", "ld19"},)


def same_stream(first: str, second: str) -> bool:
    """Return whether two models have identical streams."""
    return first == second or any({first, second} <= group for group in SAME_STREAM)
