"""Reads the state of all servos of an arm, and reports missing ones."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence

from joshua.api.clocks import StampClock

from joshua_servo.bus import ServoBus
from joshua_servo.family import ServoFamily
from joshua_servo.feedback import Feedback

#: Time for the retries of one control cycle. A loop without heartbeat for 0.3 s counts as hung.
CYCLE_S = 0.06

#: Positions further apart than this plus the wire time are read again, because one stamp would be wrong for
#: all.
COHERENT_NS = 30_000_000


class StateReader:
    """The state of one arm.

    Args:
        names: joint names by servo id, in joint order.
        parse: reads the blocks of feedback of all servos, in joint order.
    """

    def __init__(
        self,
        bus: ServoBus,
        family: ServoFamily,
        names: Mapping[int, str],
        parse: Callable[[Sequence[bytes]], list[Feedback]],
    ) -> None:
        self._bus = bus
        self._family = family
        self._names = names
        self._ids = tuple(names)
        self._parse = parse
        self._stamps = StampClock()
        self._missed = False

    @property
    def missed(self) -> bool:
        """Whether a servo did not reply to the last reading."""
        return self._missed

    def settled_feedback(self) -> list[Feedback]:
        """Feedback without time pressure. Raises NoReply and PortDisconnected."""
        address, length = self._family.feedback
        return self._parse(self._all(self._bus.sync_read(address, length, self._ids)))

    def feedback(self) -> tuple[list[Feedback], int]:
        """Feedback in joint order, and its time in ns since the epoch.

        For a control loop, which must not wait and judges how long servos may be silent. Delayed replies are
        read again, so that the time applies to all positions; the faster reading counts. Raises NoReply and
        PortDisconnected.
        """
        found, stamp_ns, spread_ns = self._timed(CYCLE_S)
        self._missed = len(found) < len(self._ids)
        values = self._all(found)
        if spread_ns > COHERENT_NS and spread_ns > COHERENT_NS + self._wire_ns():
            again, again_ns, again_spread_ns = self._timed(0.0)
            if len(again) == len(self._ids) and again_spread_ns < spread_ns:
                values, stamp_ns = self._all(again), again_ns
        return self._parse(values), stamp_ns

    def _wire_ns(self) -> int:
        """Time that the replies take on the line."""
        size = self._family.feedback[1] + self._bus.reply_overhead
        return round(self._bus.port.wire_time_s(size * len(self._ids)) * 1e9)

    def _timed(self, within_s: float) -> tuple[dict[int, bytes], int, int]:
        """Feedback of the servos that reply, the middle of the reading's duration, and that duration."""
        address, length = self._family.feedback
        before_ns = self._stamps.now_ns()
        found = self._bus.sync_read(address, length, self._ids, within_s=within_s)
        spread_ns = self._stamps.now_ns() - before_ns
        return found, before_ns + spread_ns // 2, spread_ns

    def found_positions(self, within_s: float) -> dict[int, int]:
        """Positions in ticks of the servos that reply, by id. Raises PortDisconnected.

        Args:
            within_s: no retry begins later than this.
        """
        present = self._family.present_position
        values = self._bus.sync_read(present.address, present.width, self._ids, within_s=within_s)
        return {servo_id: present.decode(value) for servo_id, value in values.items()}

    def require_all(self, found: Collection[int]) -> None:
        """Raise NoReply if a servo is missing among those found."""
        if len(found) < len(self._ids):
            self._all(dict.fromkeys(found, b""))

    def positions(self) -> list[int]:
        """Positions in the servos' ticks. Raises NoReply and PortDisconnected."""
        present = self._family.present_position
        values = self._all(self._bus.sync_read(present.address, present.width, self._ids))
        return [present.decode(value) for value in values]

    def _all(self, values: Mapping[int, bytes]) -> list[bytes]:
        """Values in joint order. Raises NoReply if some are missing."""
        missing = [servo_id for servo_id in self._ids if servo_id not in values]
        if not missing:
            return [values[servo_id] for servo_id in self._ids]
        if len(missing) == len(self._ids):
            remedy = "Check the supply and the cable to the first servo."
            raise self._bus.no_reply("no servo answers", remedy)
        names = ", ".join(f"{self._names[servo_id]} (id {servo_id})" for servo_id in missing)
        first = self._ids.index(missing[0])
        broken = (
            f"; the chain breaks after id {self._ids[first - 1]}"
            if missing == list(self._ids[first:])
            else ""
        )
        raise self._bus.no_reply(f"{names} no longer answers{broken}", "Check cable and supply.")
