"""What emulated scanners send: each turn begins once, wherever its packets begin."""

from __future__ import annotations

import pytest
from joshua_emulator.lidar.models import MODELS
from joshua_emulator.lidar.streams import StandardStream, YdlidarStream

STANDARD_NODE = 5  # bytes


@pytest.mark.parametrize("turn_hz", [0.0, 3.3, 5.5, 7.7, 10.0])
@pytest.mark.parametrize("name", ["rplidar_a1", "rplidar_c1", "ydlidar_x2", "ydlidar_x4"])
def test_each_turn_has_its_beginning(name: str, turn_hz: float) -> None:
    model = MODELS[name]
    kind = StandardStream if model.protocol == "rplidar" else YdlidarStream
    stream = kind(model, model.sample_hz, 0.0, degrees=57.0)
    stream.turn_hz = turn_hz
    begun = 0
    for _, data in stream.until(20.0):
        if kind is StandardStream:
            begun += sum(data[at] & 3 == 1 for at in range(0, len(data), STANDARD_NODE))
        else:
            begun += data.count(b"\xaa\x55") - 1  # a packet of its own
    assert begun == pytest.approx(20 * turn_hz, abs=1.1)
