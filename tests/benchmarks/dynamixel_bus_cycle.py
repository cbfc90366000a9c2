"""Bus cycle of six X-series servos at 1 Mbit/s against an emulator with true wire times.

One cycle is a sync write of four bytes (goals) and a sync read of four bytes (positions) or of 21 (all
feedback). ``_bus_cycle`` says what it is held against.
Run: python tests/benchmarks/dynamixel_bus_cycle.py
"""

from __future__ import annotations

import time

import dynamixel_sdk as sdk
from _bus_cycle import IDS, ROUNDS, Measured, head, our_cycle, report
from joshua_dynamixel.bus import Bus
from joshua_emulator import EmulatedBus

GOAL, PRESENT, FEEDBACK = 116, 132, 126


def sdk_cycle(emulator: EmulatedBus, read: tuple[int, int], measured: Measured) -> None:
    """A round with the vendor's SDK."""
    port = sdk.PortHandler(emulator.port)
    if not (port.openPort() and port.setBaudRate(1_000_000)):
        raise RuntimeError("the SDK cannot open the port")
    packets = sdk.PacketHandler(2.0)
    reader = sdk.GroupSyncRead(port, packets, *read)
    writer = sdk.GroupSyncWrite(port, packets, GOAL, 4)
    for servo_id in IDS:
        reader.addParam(servo_id)
        writer.addParam(servo_id, [0, 8, 0, 0])

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
    for address, length in ((PRESENT, 4), (FEEDBACK, 21)):
        ours, theirs = Measured(), Measured()
        with EmulatedBus("dynamixel", ids=IDS) as emulator:
            retries = 0
            for _ in range(ROUNDS):
                retries += our_cycle(emulator, Bus, (address, length), (GOAL, 4), ours)
                sdk_cycle(emulator, (address, length), theirs)
        wire_bytes = (14 + 5 * len(IDS)) + (14 + len(IDS)) + len(IDS) * (11 + length)
        report(f"read {length} B + write 4 B", wire_bytes, ours, theirs, retries)


if __name__ == "__main__":
    main()
