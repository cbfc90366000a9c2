"""The link to an emulated hub: connection, round trip, dead man's switch, and set-points on slower links.

The baseline of the round trip is the emulated radio itself: one attribute read, answered by the hub's
firmware without its program. All processes share the monotonic clock.
Run: python tests/benchmarks/spike_link.py [ROUNDS]
"""

from __future__ import annotations

import statistics
import sys
import time
from collections.abc import Sequence

import numpy as np
from joshua.devices.context import ActuatorContext
from joshua.plan import ActuatorFacts
from joshua_emulator.spike.process import EmulatedHub
from joshua_spike.actuator import SpikeActuator
from joshua_spike.pybricks import CAPABILITIES
from joshua_spike.settings import SpikeSettings

INTERVALS_S = (0.0, 0.015, 0.03, 0.05)
SET_POINT_RATE_HZ = 100.0


def make(hub: EmulatedHub) -> SpikeActuator:
    settings = {"device_name": "Pybricks Hub", "adapter": hub.adapter, "port_names": ["A", "B"]}
    context = ActuatorContext(ActuatorFacts(allow_uncalibrated=True, safe_state="RELEASE"))
    return SpikeActuator(SpikeSettings.model_validate(settings), context)


def connection_times(rounds: int) -> tuple[list[float], list[float]]:
    """Seconds from connect to the first state: with the upload of the program, and without."""
    with_upload: list[float] = []
    without: list[float] = []
    with EmulatedHub() as hub:
        actuator = make(hub)
        for _ in range(rounds):
            for times in (with_upload, without):
                begun_s = time.monotonic()
                actuator.connect()
                times.append(time.monotonic() - begun_s)
                actuator.disconnect()
            hub.fault("button")  # ends the program, so that the next connection uploads it
    return with_upload, without


def round_trips(count: int) -> tuple[list[float], list[float]]:
    """Seconds of an order to the program and of an attribute read, in turns."""
    orders, reads = [], []
    with EmulatedHub() as hub:
        actuator = make(hub)
        actuator.connect()
        client, thread = actuator._hub, actuator._hub._thread
        assert thread is not None
        ble = client.session.link._client
        assert ble is not None

        async def read() -> float:
            begun_s = time.monotonic()
            await ble.read_gatt_char(CAPABILITIES)
            return time.monotonic() - begun_s

        async def order() -> float:
            begun_s = time.monotonic()
            await client.session.order("P")
            return time.monotonic() - begun_s

        for _ in range(count):
            reads.append(thread.run(read(), 2.0))
            orders.append(thread.run(order(), 2.0))
            time.sleep(0.002)
        actuator.disconnect()
    return orders, reads


def dead_man_times(rounds: int) -> list[float]:
    """Seconds from the last set-point at the hub to the motors without torque."""
    times = []
    with EmulatedHub() as hub:
        actuator = make(hub)
        for _ in range(rounds):
            actuator.connect()
            actuator.enable()
            here = actuator.read().position_rad
            for _ in range(10):
                actuator.write(here)
                actuator.read()
            hub.fault("out_of_range", replug_after_s=1.0)
            while any(motor["powered"] for motor in hub.state()["motors"].values()):
                time.sleep(0.001)
            times.append(hub.ask("state")["t_ns"] / 1e9 - hub.log("track")[-1]["t_ns"] / 1e9)
            actuator.disconnect()
            time.sleep(1.2)
    return times


def carried(interval_s: float, duration_s: float = 2.0) -> tuple[float, float]:
    """Set-points and states a second that a radio with one event per interval carries."""
    with EmulatedHub() as hub:
        actuator = make(hub)
        actuator.connect()
        actuator.enable()
        here = actuator.read().position_rad
        hub.fault("slow", interval_s)
        before, lines = len(hub.log("track")), actuator._hub.session.number
        begun_s = time.monotonic()
        step = 0
        while time.monotonic() - begun_s < duration_s:
            step += 1
            actuator.write(here + 0.3 * np.sin(step / 50))
            time.sleep(1 / SET_POINT_RATE_HZ)
        elapsed_s = time.monotonic() - begun_s
        tracked = (len(hub.log("track")) - before) / 2 / elapsed_s
        states = (actuator._hub.session.number - lines) / elapsed_s
        actuator.disconnect()
    return tracked, states


def show(name: str, values_s: Sequence[float], baseline_s: float | None = None) -> None:
    median = statistics.median(values_s)
    ratio = f"  {median / baseline_s:5.2f} times the baseline" if baseline_s else ""
    p99 = sorted(values_s)[min(len(values_s) - 1, int(len(values_s) * 0.99))]
    print(f"{name:42} median {median * 1e3:8.2f} ms  p99 {p99 * 1e3:8.2f} ms{ratio}")


def main() -> None:
    rounds = int(sys.argv[1]) if len(sys.argv) > 1 else 8
    with_upload, without = connection_times(rounds)
    show("connection, program runs already (baseline)", without)
    show("connection with upload of the program", with_upload, statistics.median(without))
    orders, reads = round_trips(50 * rounds)
    show("attribute read, radio alone (baseline)", reads)
    show("round trip to the program and back", orders, statistics.median(reads))
    show("last set-point to motors without torque", dead_man_times(max(2, rounds // 2)))
    for interval_s in INTERVALS_S:
        tracked, states = carried(interval_s)
        print(
            f"one radio event every {interval_s * 1e3:4.0f} ms: {tracked:5.1f} set-points/s of "
            f"{SET_POINT_RATE_HZ:.0f} written, {states:5.1f} states/s"
        )


if __name__ == "__main__":
    main()
