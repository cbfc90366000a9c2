"""Bus cycle of six STS3215 servos at 1 Mbit/s against an emulator with true wire times.

One cycle is a sync write of two bytes (goals) and a sync read of two bytes (positions) or of 15 (all
feedback). ``_bus_cycle`` says what it is held against.
Run: python tests/benchmarks/sts3215_bus_cycle.py
"""

from __future__ import annotations

import time

import scservo_sdk as sdk
from _bus_cycle import IDS, ROUNDS, Measured, head, our_cycle, report
from joshua_emulator import EmulatedBus
from joshua_sts3215.bus import Bus

GOAL, PRESENT = 42, 56


def sdk_cycle(emulator: EmulatedBus, length: int, measured: Measured) -> None:
    """A round with the vendor's SDK."""
    port = sdk.PortHandler(emulator.port)
    if not (port.openPort() and port.setBaudRate(1_000_000)):
        raise RuntimeError("the SDK cannot open the port")
    packets = sdk.protocol_packet_handler()
    reader = sdk.GroupSyncRead(port, packets, PRESENT, length)
    writer = sdk.GroupSyncWrite(port, packets, GOAL, 2)
    for servo_id in IDS:
        reader.addParam(servo_id)
        writer.addParam(servo_id, [0, 8])

    def cycle() -> int:
        writer.txPacket()
        written_ns = time.monotonic_ns()
        reader.txRxPacket()
        return written_ns

    measured.add(emulator, cycle)
    port.closePort()


def main() -> None:
    """Prints one table for each length of the read."""
    head()
    for length in (2, 15):
        ours, theirs = Measured(), Measured()
        with EmulatedBus(ids=IDS) as emulator:
            retries = 0
            for _ in range(ROUNDS):
                retries += our_cycle(emulator, Bus, (PRESENT, length), (GOAL, 2), ours)
                sdk_cycle(emulator, length, theirs)
        wire_bytes = (8 + 3 * len(IDS)) + (8 + len(IDS)) + len(IDS) * (6 + length)
        report(f"read {length} B + write 2 B", wire_bytes, ours, theirs, retries)


if __name__ == "__main__":
    main()
