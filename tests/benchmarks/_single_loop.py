"""The loop of a program like LeRobot's: read the leader, write the follower, wait; with the vendor's SDK.

Run by ``teleop_latency.py``: LEADER_PORT FOLLOWER_PORT RATE_HZ SECONDS.
"""

from __future__ import annotations

import sys
import time

import scservo_sdk as sdk

IDS = (1, 2, 3, 4, 5, 6)
GOAL, PRESENT = 42, 56


def opened(path: str) -> sdk.PortHandler:
    """Opens a port at the speed of the servos."""
    port = sdk.PortHandler(path)
    if not (port.openPort() and port.setBaudRate(1_000_000)):
        raise RuntimeError(f"cannot open {path}")
    return port


def main() -> None:
    """Runs the loop for the time that the command line says."""
    leader, follower, rate_hz, seconds = sys.argv[1:]
    packets = sdk.protocol_packet_handler()
    port = opened(leader)
    reader = sdk.GroupSyncRead(port, packets, PRESENT, 2)
    writer = sdk.GroupSyncWrite(opened(follower), packets, GOAL, 2)
    for servo_id in IDS:
        reader.addParam(servo_id)
        writer.addParam(servo_id, [0, 8])
    start_s = due_s = time.monotonic()
    while time.monotonic() < start_s + float(seconds):
        port.ser.reset_input_buffer()  # else one late reply makes every later one a cycle old
        if reader.txRxPacket() == sdk.COMM_SUCCESS:
            for servo_id in IDS:
                position = reader.getData(servo_id, PRESENT, 2)
                writer.changeParam(servo_id, [position & 0xFF, position >> 8])
            writer.txPacket()
        due_s += 1 / float(rate_hz)
        time.sleep(max(0.0, due_s - time.monotonic()))


if __name__ == "__main__":
    main()
