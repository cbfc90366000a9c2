"""Speed of the laser scanners' parsers on one core, as a multiple of what their lines can carry.

Each parser gets some seconds of its scanner's stream in pieces as the driver reads them (10 ms of the line)
and in large ones, then the same with one byte in a thousand changed. The line's rate is its baudrate over ten
bits a byte, which no scanner fills. The last column is the share of the measurements of such a damaged stream
that is still handed on. For comparison a published client, rplidar-roboticia, reads the same
standard scan in the same run. Target: at least ten times the line's rate.
Run: python tests/benchmarks/lidar_parsers.py
"""

from __future__ import annotations

import importlib.util
import random
import sys
import time
from collections.abc import Callable
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "support"))

from lidar_streams import PROTOCOLS, Protocol

ROUNDS = 5
STREAM_S = 4.0
PIECE_S = 0.01
LARGE = 16_384
DAMAGED_SHARE = 0.001
TARGET = 10.0


def stream(protocol: Protocol) -> bytes:
    """Packets that fill the line for some seconds."""
    sample = protocol.pieces(50)
    size = sum(map(len, sample)) / 50
    return b"".join(protocol.pieces(round(protocol.line_bytes_s * STREAM_S / size)))


def seconds(work: Callable[[], None]) -> float:
    """Processor time of the least disturbed round."""
    best = float("inf")
    for _ in range(ROUNDS):
        start = time.process_time()
        work()
        best = min(best, time.process_time() - start)
    return best


def multiple(protocol: Protocol, data: bytes, piece: int) -> float:
    """Rate of a parser over the rate of its line."""

    def work() -> None:
        parser = protocol.parser()
        for start in range(0, len(data), piece):
            parser.feed(data[start : start + piece])

    return len(data) / seconds(work) / protocol.line_bytes_s


def peer_multiple(data: bytes) -> float:
    """The same figure for rplidar-roboticia's reading of nodes; it finds no step by itself."""
    import rplidar

    def work() -> None:
        for start in range(0, len(data) - 4, 5):
            rplidar._process_scan(data[start : start + 5])

    return len(data) / seconds(work) / PROTOCOLS["rplidar_standard"].line_bytes_s


def damaged(data: bytes) -> bytes:
    """The stream of a poor line."""
    draw = random.Random(9)
    changed = bytearray(data)
    for _ in range(round(len(data) * DAMAGED_SHARE)):
        changed[draw.randrange(len(changed))] ^= draw.randrange(1, 256)
    return bytes(changed)


def handed_on(protocol: Protocol, data: bytes) -> float:
    """Share of the measurements of a damaged stream that count."""
    return len(protocol.parser().feed(damaged(data))) / len(protocol.parser().feed(data))


def main() -> int:
    """Prints the table; 1 where a parser misses the target."""
    good = True
    print(f"{'parser':<18}{'10 ms pieces':>14}{'16 KiB pieces':>15}{'damaged line':>14}{'handed on':>11}")
    for name, protocol in PROTOCOLS.items():
        data = stream(protocol)
        small = round(protocol.line_bytes_s * PIECE_S)
        figures = (
            multiple(protocol, data, small),
            multiple(protocol, data, LARGE),
            multiple(protocol, damaged(data), small),
        )
        good = good and min(figures) >= TARGET
        share = handed_on(protocol, data)
        print(f"{name:<18}{figures[0]:>13.0f}x{figures[1]:>14.0f}x{figures[2]:>13.0f}x{share:>11.0%}")
    if importlib.util.find_spec("rplidar") is not None:
        figure = peer_multiple(stream(PROTOCOLS["rplidar_standard"]))
        print(f"{'rplidar-roboticia':<18}{'':>14}{figure:>14.0f}x   the standard scan, node by node, in step")
    print("speeds are multiples of the line's rate")
    print(f"target: {TARGET:.0f}x, {'reached by all' if good else 'missed'}")
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())
