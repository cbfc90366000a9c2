"""Bus cycle of six STS3215 servos at 1 Mbit/s against an emulator with true wire times.

One cycle is a sync write of two bytes (goals) and a sync read of two bytes (positions) or of 15 (all
feedback). The bound is the calculated time of all bytes on the line plus the emulator's own delay: from the
end of the host's write to the emulator's receipt of it, and from a reply's wire time to its hand-over, both
by the monotonic clock that the processes share. The vendor's SDK does the same cycles on the same emulator,
in turn with ours, so that the load of the machine meets both.
Run: python tests/benchmarks/sts3215_bus_cycle.py
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable
from dataclasses import dataclass, field

import scservo_sdk as sdk
from joshua.devices.serial_port import SerialPort
from joshua.devices.usb_ports import Endpoint
from joshua_emulator import EmulatedBus
from joshua_sts3215.bus import Bus

IDS = (1, 2, 3, 4, 5, 6)
GOAL, PRESENT = 42, 56
ROUNDS, CYCLES = 5, 200
BYTE_S = 10 / 1_000_000


@dataclass
class Measured:
    """Times of single cycles, and CPU time and the emulator's mean delay of all rounds."""

    cycles_s: list[float] = field(default_factory=list)
    cpu_s: float = 0.0
    delays_s: list[float] = field(default_factory=list)

    def add(self, emulator: EmulatedBus, cycle: Callable[[], int]) -> None:
        """Measures one round; a cycle returns when its write had left the host, monotonic clock in ns."""
        cycle()
        emulator.ask("lateness", clear=True)
        before = emulator.log("sync_write")[-1]["sequence"]
        written_ns = []
        cpu_s = time.process_time()
        for _ in range(CYCLES):
            start_s = time.perf_counter()
            written_ns.append(cycle())
            self.cycles_s.append(time.perf_counter() - start_s)
        self.cpu_s += time.process_time() - cpu_s
        received_ns = [entry["t_ns"] for entry in emulator.log("sync_write", since=before)]
        hearing_ns = [max(0, r - w) for r, w in zip(received_ns, written_ns, strict=True)]
        self.delays_s.append(statistics.fmean(hearing_ns) / 1e9 + emulator.ask("lateness")["mean_s"])


def our_cycle(emulator: EmulatedBus, length: int, measured: Measured) -> Bus:
    """A round with the driver's own bus."""
    port = SerialPort(Endpoint(emulator.port, device_root=str(emulator.root)), 1_000_000)
    port.open()
    bus = Bus(port)
    bus.detect_echo()
    rows = {servo_id: (2048).to_bytes(2, "little") for servo_id in IDS}

    def cycle() -> int:
        bus.sync_write(GOAL, 2, rows)
        written_ns = time.monotonic_ns()
        if len(bus.sync_read(PRESENT, length, IDS)) != len(IDS):
            raise RuntimeError("a reply was lost on a line without faults")
        return written_ns

    measured.add(emulator, cycle)
    port.close()
    return bus


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
    titles = ("median ms", "mean ms", "p99 ms", "CPU ms", "bound ms", "ratio")
    print(f"{'cycle':<22}{'client':<8}" + "".join(f"{title:>10}" for title in titles))
    for length in (2, 15):
        ours, theirs = Measured(), Measured()
        with EmulatedBus(ids=IDS) as emulator:
            retries = 0
            for _ in range(ROUNDS):
                retries += our_cycle(emulator, length, ours).counters.retries
                sdk_cycle(emulator, length, theirs)
        wire_s = BYTE_S * ((8 + 3 * len(IDS)) + (8 + len(IDS)) + len(IDS) * (6 + length))
        for name, measured in (("joshua", ours), ("SDK", theirs)):
            mean_s = statistics.fmean(measured.cycles_s)
            bound_s = wire_s + statistics.fmean(measured.delays_s)
            milliseconds = (
                statistics.median(measured.cycles_s),
                mean_s,
                statistics.quantiles(measured.cycles_s, n=100)[98],
                measured.cpu_s / len(measured.cycles_s),
                bound_s,
            )
            figures = "".join(f"{value * 1e3:>10.3f}" for value in milliseconds)
            print(f"{f'read {length} B + write 2 B':<22}{name:<8}{figures}{mean_s / bound_s:>10.3f}")
        wall = statistics.fmean(ours.cycles_s) / statistics.fmean(theirs.cycles_s)
        print(
            f"  bus minimum {wire_s * 1e3:.3f} ms; joshua takes {wall:.2f} of the SDK's time and "
            f"{ours.cpu_s / theirs.cpu_s:.3f} of its CPU; {retries} retries"
        )


if __name__ == "__main__":
    main()
