"""Cycles of an emulated servo bus: ours and the vendor's SDK in turn, against what the line allows.

The bound is the calculated time of all bytes on the line plus the emulator's own delay: from the end of the
host's write to the emulator's receipt of it, and from a reply's wire time to its hand-over, both by the
monotonic clock that the processes share. The vendor's SDK does the same cycles on the same emulator, in turn
with ours, so that the load of the machine meets both.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable
from dataclasses import dataclass, field

from joshua_emulator import EmulatedBus
from joshua_serial.port import SerialPort
from joshua_serial.usb_ports import Endpoint
from joshua_servo.bus import ServoBus

IDS = (1, 2, 3, 4, 5, 6)
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


def our_cycle(
    emulator: EmulatedBus,
    make_bus: type[ServoBus],
    read: tuple[int, int],
    write: tuple[int, int],
    measured: Measured,
) -> int:
    """A round with the driver's own bus; returns how many requests were repeated.

    Args:
        read, write: address and width of what a cycle reads and writes of each servo.
    """
    port = SerialPort(Endpoint(emulator.port, device_root=str(emulator.root)), 1_000_000)
    port.open()
    bus = make_bus(port)
    bus.detect_echo()
    rows = {servo_id: (2048).to_bytes(write[1], "little") for servo_id in IDS}

    def cycle() -> int:
        bus.sync_write(*write, rows)
        written_ns = time.monotonic_ns()
        if len(bus.sync_read(*read, IDS)) != len(IDS):
            raise RuntimeError("a reply was lost on a line without faults")
        return written_ns

    measured.add(emulator, cycle)
    port.close()
    return bus.counters.retries


def head() -> None:
    """Prints the head of the table."""
    titles = ("median ms", "mean ms", "p99 ms", "CPU ms", "bound ms", "ratio")
    print(f"{'cycle':<22}{'client':<8}" + "".join(f"{title:>10}" for title in titles))


def report(cycle: str, wire_bytes: int, ours: Measured, theirs: Measured, retries: int) -> None:
    """Prints the rows of one cycle of so many bytes on the line, and what they say."""
    wire_s = wire_bytes * BYTE_S
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
        print(f"{cycle:<22}{name:<8}{figures}{mean_s / bound_s:>10.3f}")
    wall = statistics.fmean(ours.cycles_s) / statistics.fmean(theirs.cycles_s)
    print(
        f"  bus minimum {wire_s * 1e3:.3f} ms; joshua takes {wall:.2f} of the SDK's time and "
        f"{ours.cpu_s / theirs.cpu_s:.3f} of its CPU; {retries} retries"
    )
