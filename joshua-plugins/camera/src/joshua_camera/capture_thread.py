"""The thread that drains a camera's buffers and keeps only the newest picture."""

from __future__ import annotations

import atexit
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass

from joshua.api import Cancelled, DeviceDisconnected, DeviceError
from joshua.api.clocks import AwakeClock, StampClock, ros_time

from joshua_camera.backlog import Backlog
from joshua_camera.capture import Capture, Grab
from joshua_camera.figures import FigureKeeper
from joshua_camera.limits import stall_limit_s
from joshua_camera.picture import Picture

#: Longest wait for the end of the thread; a library call that does not wake up ends later by itself.
JOIN_S = 1.0

#: If the clock is set back by more than this, stamps restart instead of standing still.
LARGEST_CLOCK_STEP_NS = 500_000_000

_LOOK_S = 0.05  # longest delay until a stop or a missing picture is noticed

#: If reading both clocks takes longer, it was interrupted and is repeated.
_CLOSE_NS = 1_000_000
_CLOCK_ATTEMPTS = 10

_EXPOSURE_EVERY_NS = 1_000_000_000
_NS_PER_S = 1_000_000_000


@dataclass(frozen=True)
class Newest:
    """The newest picture: sequence number, stamp (ns since the epoch), acquisition time (monotonic)."""

    number: int
    stamp_ns: int
    acquired_ns: int
    picture: Picture


class CaptureThread:
    """Owns a capture from opening to closing, so that only one thread uses OpenCV."""

    def __init__(self, capture: Capture) -> None:
        self.figures = FigureKeeper()
        self._capture = capture
        self._changed = threading.Condition()
        self._stop = threading.Event()
        self._taken = -1
        self._newest: Newest | None = None
        self._failure: DeviceError | None = None
        self._last_ns = 0
        self._awake = AwakeClock()  # of threads that wait for pictures
        self._heard = (0, 0.0)  # the last picture that they received, and when
        self._last_stamp_ns = 0
        self._simulated = StampClock()
        self._thread = threading.Thread(target=self._run, name="camera", daemon=True)

    @property
    def refused(self) -> tuple[str, ...]:
        """Settings that the camera did not apply."""
        return tuple(self._capture.refused)

    @property
    def notes(self) -> tuple[str, ...]:
        """Settings that have no effect on this camera."""
        return tuple(self._capture.notes)

    def open(self, timeout_s: float, stopping: Callable[[], bool] = lambda: False) -> None:
        """Start the thread and wait for the first picture.

        Args:
            stopping: polled; the wait ends when it returns true.

        Raises:
            DeviceError: no picture in time; the thread has ended, as with Cancelled.
            Cancelled: the run ends.
        """
        # A thread that still waits inside OpenCV when the interpreter ends would abort the process.
        atexit.register(self.close)
        self._thread.start()
        deadline_s, obeys = self._awake.now_s() + timeout_s, False
        with self._changed:
            while self._newest is None and self._failure is None and not self._stop.is_set():
                left_s = deadline_s - self._awake.now_s()
                if left_s <= 0 or (obeys := stopping()):
                    break
                self._changed.wait(min(left_s, _LOOK_S))
            ready, failure, stopped = self._newest is not None, self._failure, self._stop.is_set()
        if ready:
            return
        self.close()
        if obeys:
            raise Cancelled
        label = self._capture.source.label
        if failure is not None:
            raise failure
        if stopped:
            raise DeviceError(f"{label} was closed while opening: open it again")
        raise DeviceError(
            f"{label} delivered no picture within {timeout_s:g} s ({self._what_came()}): check cable and "
            "power, and that no other program uses it; several cameras on one USB hub need pixel_format "
            '"MJPG" or a hub each'
        )

    def take(self, timeout_s: float) -> Newest | None:
        """Wait for a new picture; None if none arrives in time.

        Raises:
            DeviceDisconnected: the stream ended or stalled.
        """
        deadline_s = time.monotonic() + timeout_s
        with self._changed:
            while True:
                newest = self._newest
                if newest is not None and newest.number > self._taken:
                    self._taken = newest.number
                    return newest
                if self._failure is not None:
                    raise self._failure
                self._check_stall()
                wait_s = deadline_s - time.monotonic()
                if wait_s <= 0 or self._stop.is_set():
                    return None
                self._changed.wait(min(wait_s, _LOOK_S))

    def interrupt(self) -> None:
        """Abort ``open``, ``take`` and the thread without waiting. Thread-safe."""
        with self._changed:
            self._stop.set()
            self._changed.notify_all()
        self._capture.interrupt()

    def close(self) -> None:
        """End the thread. Idempotent."""
        atexit.unregister(self.close)
        self.interrupt()
        clock = AwakeClock()
        while self._thread.is_alive() and self._thread is not threading.current_thread():
            left_s = JOIN_S - clock.now_s()
            if left_s <= 0:
                return
            self._thread.join(min(left_s, _LOOK_S))

    @property
    def alive(self) -> bool:
        """Whether the thread is running."""
        return self._thread.is_alive()

    def _run(self) -> None:
        capture = self._capture
        try:
            capture.open()
            self._loop()
        except DeviceError as error:
            self._fail(error)
        except Exception as error:  # noqa: BLE001 - OpenCV's own exceptions; the reader must hear of it
            text = " ".join(str(error).split())
            self._fail(DeviceDisconnected(f"{capture.source.label} failed in OpenCV: {text}"))
        finally:
            capture.close()

    def _loop(self) -> None:
        capture, settings = self._capture, self._capture.settings
        live_by_arrival = capture.source.live and not capture.has_own_clock
        backlog = Backlog(settings.fps) if live_by_arrival else None
        self.figures.pixel_format = capture.pixel_format()
        exposure_due_ns = 0
        while not self._stop.is_set():
            grab = capture.grab()
            if grab is None:
                if not self._stop.is_set():
                    hint = "cable, power and network" if capture.source.live else "that the files can be read"
                    raise DeviceDisconnected(f"{capture.source.label} ended its stream: check {hint}")
                return
            self._last_ns = grab.ended_ns
            number = self.figures.received
            self.figures.arrived(grab.ended_ns)
            fresh = backlog is None or backlog.is_fresh(grab.began_ns, grab.ended_ns, grab.slept_ns)
            if grab.picture is None:
                self.figures.damaged += 1
            elif not fresh:
                self.figures.stale += 1
            else:
                self._offer(grab, number, grab.picture)
            if grab.ended_ns >= exposure_due_ns:
                exposure_due_ns = grab.ended_ns + _EXPOSURE_EVERY_NS
                self.figures.exposure = capture.exposure()

    def _offer(self, grab: Grab, number: int, picture: Picture) -> None:
        settings = self._capture.settings
        if (grab.width, grab.height) != (settings.width, settings.height):
            raise DeviceError(
                f"{self._capture.source.label} delivers {grab.width} × {grab.height}, and the file asks for "
                f"{settings.width} × {settings.height}: set width: {grab.width} height: {grab.height}, or "
                "another size at the camera"
            )
        newest = Newest(number, self._stamp_ns(grab.acquired_ns), grab.acquired_ns, picture)
        with self._changed:
            if self._newest is not None and self._newest.number > self._taken:
                self.figures.dropped += 1
            self._newest = newest
            self._changed.notify_all()

    def _stamp_ns(self, acquired_ns: int) -> int:
        """Return the stamp of an acquisition time; always later than the one before."""
        if ros_time.is_simulated():
            return self._simulated.now_ns()
        stamp_ns = _epoch_offset_ns() + acquired_ns
        behind_ns = self._last_stamp_ns - stamp_ns
        if behind_ns > LARGEST_CLOCK_STEP_NS:
            raise DeviceDisconnected(
                f"the system clock was set back by {behind_ns / _NS_PER_S:.1f} s: "
                f"{self._capture.source.label} starts its time stamps again"
            )
        self._last_stamp_ns = max(stamp_ns, self._last_stamp_ns + 1)
        return self._last_stamp_ns

    def _fail(self, error: DeviceError) -> None:
        with self._changed:
            self._failure = error
            self._changed.notify_all()

    def _check_stall(self) -> None:
        limit_s = stall_limit_s(self._capture.settings.fps)
        now_s, last_ns = self._awake.now_s(), self._last_ns
        if last_ns != self._heard[0]:
            self._heard = (last_ns, now_s)
        elif now_s - self._heard[1] > limit_s:
            raise DeviceDisconnected(
                f"{self._capture.source.label} has delivered no picture for {limit_s:g} s: check cable, "
                "power and network"
            )

    def _what_came(self) -> str:
        figures = self.figures
        if not figures.received:
            return "nothing was received"
        return f"{figures.received} were received, {figures.damaged} of them damaged, {figures.stale} stale"


def _epoch_offset_ns() -> int:
    """Return the epoch time minus the monotonic time in ns, read together."""
    for _ in range(_CLOCK_ATTEMPTS):
        before_ns = time.monotonic_ns()
        wall_ns = time.time_ns()
        after_ns = time.monotonic_ns()
        if after_ns - before_ns <= _CLOSE_NS:
            break
    return wall_ns - after_ns
