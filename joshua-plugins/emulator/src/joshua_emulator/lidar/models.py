"""The scanners that can be emulated, as data."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class ScannerModel:
    """One scanner.

    Attributes:
        name: as in ``LidarConfig.model``.
        protocol: name of its stream: ld06, lds01, ydlidar or rplidar.
        baudrate: of its line; turn_hz: turns per second; sample_hz: measurements per second.
        express_hz: measurements per second of an RPLIDAR's express scan.
        waits: sends nothing before it is asked to.
        number: model number that it answers with.
    """

    name: str
    protocol: str
    baudrate: int
    turn_hz: float
    sample_hz: float
    waits: bool = False
    number: int = 0
    express_hz: float = 0.0


MODELS = {
    model.name: model
    for model in (
        ScannerModel("rplidar_a1", "rplidar", 115_200, 5.5, 2000, True, 0x18, 4000),
        ScannerModel("rplidar_c1", "rplidar", 460_800, 10.0, 5000, True, 0x41, 5000),
        ScannerModel("ld06", "ld06", 230_400, 10.0, 4500),
        ScannerModel("ld19", "ld06", 230_400, 10.0, 4500),
        ScannerModel("lds01", "lds01", 230_400, 5.0, 1800, True),
        ScannerModel("ydlidar_x2", "ydlidar", 115_200, 7.0, 3000),
        ScannerModel("ydlidar_x4", "ydlidar", 128_000, 7.0, 5000, True, 6),
    )
}
