"""Blocking interface to a hub: the session and its loop thread, opened and closed together."""

from __future__ import annotations

from collections.abc import Callable

from joshua.api import DeviceError
from joshua.api.clocks import AwakeClock

from joshua_spike.errors import HubUnreachable, LinkLost
from joshua_spike.hub.program import load_program
from joshua_spike.lines import HubState
from joshua_spike.loop_thread import LoopThread
from joshua_spike.pybricks import Status
from joshua_spike.session import Counters, HubSession, StampedState
from joshua_spike.settings import SpikeSettings

OPEN_TIMEOUT_S = 90.0  # longer than the sum of the steps' own timeouts
CLOSE_TIMEOUT_S = 10.0
ORDER_TIMEOUT_S = 6.0
STATE_TIMEOUT_S = 1.0  # longest time without a state; stalls of this process do not count
_LOOK_S = 0.1
DEAD_MAN_S = 0.5


class HubClient:
    """One hub.

    Args:
        settings: of the driver.
        hold: whether the dead man's switch holds the motors or releases them.
    """

    def __init__(self, settings: SpikeSettings, *, hold: bool) -> None:
        self._settings = settings
        self._hold = hold
        self._thread: LoopThread | None = None
        self._session: HubSession | None = None
        self._seen = 0

    @property
    def is_open(self) -> bool:
        """Whether the hub is open."""
        return self._session is not None

    @property
    def address(self) -> str:
        """Bluetooth address of the hub; "" while unknown."""
        return self._session.link.address if self._session is not None else ""

    @property
    def counters(self) -> Counters:
        """Link counters."""
        return self._session.counters if self._session is not None else Counters()

    @property
    def status(self) -> Status:
        """Last status of the hub."""
        return self._session.link.status if self._session is not None else Status(0)

    @property
    def session(self) -> HubSession:
        """Return the open session. Raises DeviceError if there is none."""
        if self._session is None:
            raise DeviceError(
                f"hub {self._settings.device_name!r}: the device is not open: call connect first"
            )
        return self._session

    def __str__(self) -> str:
        return str(self._session.link) if self._session is not None else f"hub {self._settings.device_name!r}"

    def open(self, stopping: Callable[[], bool] = lambda: False) -> None:
        """Find the hub, start its program, check its motors. Raises DeviceError, Cancelled."""
        settings = self._settings
        program = load_program()
        thread = LoopThread(f"hub {settings.device_name}")
        thread.start()

        async def open_session() -> HubSession:
            session = HubSession(
                settings.device_name,
                settings.service_uuid,
                settings.adapter,
                settings.port_names,
                dead_man_s=DEAD_MAN_S,
                dead_man_action="H" if self._hold else "F",
            )
            try:
                await session.open(program)
            except BaseException:
                await session.close()
                raise
            return session

        try:
            self._session = thread.run(open_session(), OPEN_TIMEOUT_S, stopping)
        except BaseException as error:
            thread.close()
            if isinstance(error, TimeoutError):
                raise HubUnreachable(
                    f"hub {settings.device_name!r}: did not open within {OPEN_TIMEOUT_S:g} s. Switch it off "
                    "and on"
                ) from error
            raise
        self._thread = thread
        self._seen = 0

    def close(self) -> None:
        """Close the link. The program on the hub continues. Idempotent."""
        thread, session = self._thread, self._session
        self._thread = self._session = None
        if thread is None or session is None:
            return
        try:
            thread.run(session.close(), CLOSE_TIMEOUT_S)
        except TimeoutError:
            pass  # the end of the thread cancels pending waits
        finally:
            thread.close()

    def next_state(self) -> StampedState:
        """Return the newest state that was not returned before. Raises LinkLost, ProgramFailed."""
        session = self.session
        clock = AwakeClock()
        with session.changed:
            while session.end is None and session.number == self._seen:
                left_s = STATE_TIMEOUT_S - clock.now_s()
                if left_s <= 0:
                    raise LinkLost(
                        f"{self}: no state received for {STATE_TIMEOUT_S:g} s, although the link is up. "
                        f"Move closer. The hub's dead man's switch stops the motors after {DEAD_MAN_S:g} s"
                    )
                session.changed.wait(min(left_s, _LOOK_S))
            if session.end is not None:
                raise session.end
            self._seen = session.number
            assert session.latest is not None
            return session.latest

    def order(self, kind: str) -> HubState:
        """Make the hub execute a command now. Raises LinkLost, ProgramFailed."""
        session = self.session
        assert self._thread is not None
        try:
            return self._thread.run(session.order(kind), ORDER_TIMEOUT_S)
        except TimeoutError as error:
            raise LinkLost(f"{self}: does not respond to commands. Move closer") from error

    def follow(self, targets_deg: tuple[int, ...]) -> None:
        """Queue targets; newer ones replace them. Raises LinkLost, ProgramFailed."""
        session = self.session
        if session.end is not None:
            raise session.end
        assert self._thread is not None
        self._thread.call(session.follow, targets_deg)
