"""Pictures that waited in a buffer are told from new ones, on simulated times."""

from __future__ import annotations

from joshua_camera.backlog import Backlog

MS = 1_000_000
WORK_MS = 0.1


class Stream:
    """Feeds arrival times in ms; a reader waits from the last arrival on unless it was held up."""

    def __init__(self, fps: float) -> None:
        self.backlog = Backlog(fps)
        self.free_ms = 0.0

    def picture(self, in_buffer_ms: float, *, held_until_ms: float = 0.0) -> bool:
        began_ms = max(self.free_ms, held_until_ms)
        self.free_ms = max(began_ms, in_buffer_ms) + WORK_MS
        slept_ms = max(0.0, in_buffer_ms - began_ms)
        return self.backlog.is_fresh(*(round(time_ms * MS) for time_ms in (began_ms, self.free_ms, slept_ms)))


def test_a_steady_stream_is_fresh() -> None:
    stream = Stream(30)
    assert all(stream.picture(33.3 * index) for index in range(1, 100))


def test_jitter_is_fresh() -> None:
    stream = Stream(30)
    jitter = (0, 9, -9, 5, -12, 12, 0, 3)
    assert all(stream.picture(33.3 * index + jitter[index % 8]) for index in range(1, 100))


def test_what_was_buffered_at_the_opening_is_old() -> None:
    stream = Stream(30)
    assert [stream.picture(at) for at in (0, 0, 0, 20, 53, 86)] == [False, False, False, True, True, True]


def test_after_a_pause_the_burst_is_old() -> None:
    stream = Stream(30)
    for index in range(1, 20):
        stream.picture(33.3 * index)
    # the network pauses for a second, then delivers 30 pictures at once, then goes on
    burst = [stream.picture(1700) for _ in range(30)]
    assert not any(burst)
    assert [stream.picture(1733), stream.picture(1766)] == [True, True]


def test_a_reader_that_was_held_up_finds_old_pictures() -> None:
    stream = Stream(30)
    for index in range(1, 20):
        stream.picture(33.3 * index)
    assert not stream.picture(666, held_until_ms=760)
    assert not stream.picture(699)
    assert not stream.picture(733)
    assert stream.picture(799)


def test_a_camera_that_slows_down_is_followed() -> None:
    stream = Stream(30)
    for index in range(1, 20):
        stream.picture(33.3 * index)
    slow = [stream.picture(700 + 200 * index) for index in range(20)]
    assert all(slow[5:])


def test_another_rate_than_expected_is_learned() -> None:
    stream = Stream(30)
    fresh = [stream.picture(500 * index) for index in range(1, 20)]
    assert all(fresh[5:])


def test_a_faster_camera_than_expected_is_learned() -> None:
    for rate in (60, 90, 200):
        stream = Stream(30)
        fresh = [stream.picture(1000 / rate * index) for index in range(1, 40)]
        assert all(fresh[6:])


def test_pictures_in_pairs_are_not_lost_for_ever() -> None:
    stream = Stream(30)
    fresh = [stream.picture(66.6 * (index // 2)) for index in range(2, 60)]
    assert sum(fresh[10:]) >= 20
