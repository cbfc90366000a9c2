"""Reads several registers of several servos in as few requests as the servos allow."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from joshua_servo.bus import ServoBus
from joshua_servo.family import ServoFamily
from joshua_servo.register import Register


def read_registers(
    bus: ServoBus,
    family: ServoFamily,
    registers: Iterable[Register],
    ids: tuple[int, ...],
    *,
    within_s: float | None = None,
) -> dict[int, dict[Register, bytes]]:
    """Bytes of each register by servo id, without servos that do not reply to every request.

    Args:
        within_s: of each request, see ``ServoBus.sync_read``.

    Raises PortDisconnected.
    """
    found: dict[int, dict[Register, bytes]] = {servo_id: {} for servo_id in ids}
    for group in _groups(sorted(registers, key=lambda register: register.address), family.reads_gaps):
        start = group[0].address
        values = bus.sync_read(start, group[-1].end - start, tuple(found), within_s=within_s)
        found = {
            servo_id: {
                **found[servo_id],
                **{register: block[register.address - start : register.end - start] for register in group},
            }
            for servo_id, block in values.items()
        }
        if not found:
            break
    return found


def _groups(registers: list[Register], over_gaps: bool) -> Iterator[list[Register]]:
    """Registers for one request: neighbours, or all if the bytes between them may be read."""
    group: list[Register] = []
    for register in registers:
        if group and not over_gaps and register.address != group[-1].end:
            yield group
            group = []
        group.append(register)
    yield group
