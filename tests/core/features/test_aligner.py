"""Frames from streams, against a search through all samples."""

from __future__ import annotations

import threading

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from joshua.features import ACTION, STATE, Alignment, Feature, Frame, TimeAligner
from joshua.features.aligner import HORIZON_NS

MS = 1_000_000
START = 1_700_000_000 * 1_000_000_000
RATE_HZ = 50.0
TOLERANCE = 15 * MS

Samples = dict[int, float]


def value(number: float) -> np.ndarray:
    return np.array([number, -number])


def searched(samples: Samples, at_ns: int, method: str) -> tuple[int, float] | None:
    """Stamp and value at a time, with all samples at hand."""
    if not samples:
        return None
    nearest = min(samples, key=lambda stamp: (abs(stamp - at_ns), stamp))
    if abs(nearest - at_ns) > TOLERANCE:
        return None
    if method == "nearest" or nearest == at_ns:
        return nearest, samples[nearest]
    before = max((stamp for stamp in samples if stamp < at_ns), default=None)
    after = min((stamp for stamp in samples if stamp >= at_ns), default=None)
    if before is None or after is None or after - before > 2 * TOLERANCE:
        return None
    return nearest, float(np.interp(0, [before - at_ns, after - at_ns], [samples[before], samples[after]]))


stamps = st.integers(-30 * MS, 500 * MS).map(lambda offset: START + offset)
streams = st.dictionaries(stamps, st.floats(-1e3, 1e3), max_size=40)
methods = st.sampled_from(["nearest", "interpolated"])


def check(frames: list[Frame], samples: dict[str, Samples], method: str) -> None:
    for frame in frames:
        for key, stream in samples.items():
            wanted = searched(stream, frame.stamp_ns, method)
            if wanted is None:
                assert key in frame.missing
                assert key not in frame.values
            else:
                assert frame.stamps_ns[key] == wanted[0]
                assert frame[key] == pytest.approx(value(wanted[1]), abs=1e-9)


@given(samples=st.fixed_dictionaries({"a": streams, "b": streams}), method=methods, data=st.data())
def test_whatever_the_order_each_frame_has_what_a_search_finds(
    samples: dict[str, Samples], method: str, data: st.DataObject
) -> None:
    aligner = TimeAligner(dict.fromkeys(samples, Alignment(TOLERANCE, method)), RATE_HZ)  # type: ignore[arg-type]
    aligner.start(START)
    everything = [(key, stamp, number) for key, stream in samples.items() for stamp, number in stream.items()]
    for key, stamp, number in data.draw(st.permutations(everything)):
        aligner.push(key, stamp, value(number))
    frames = aligner.poll(START + 400 * MS + aligner._wait_ns)
    # two samples may lie equally far from a frame: the search and the aligner take the earlier one
    assert [frame.stamp_ns for frame in frames][:21] == [START + 20 * MS * k for k in range(21)]
    check(frames, samples, method)


@given(
    samples=st.fixed_dictionaries({"a": streams, "b": streams}),
    delays=st.tuples(st.integers(0, 15 * MS), st.integers(0, 15 * MS)),
    method=methods,
    period=st.integers(1 * MS, 60 * MS),
)
def test_streams_that_come_within_the_wait_lose_nothing(
    samples: dict[str, Samples], delays: tuple[int, int], method: str, period: int
) -> None:
    aligner = TimeAligner(
        dict.fromkeys(samples, Alignment(TOLERANCE, method)),  # type: ignore[arg-type]
        RATE_HZ,
        wait_ns=2 * TOLERANCE,
    )
    arrivals = sorted(
        (stamp + delay, key, stamp)
        for (key, stream), delay in zip(samples.items(), delays, strict=True)
        for stamp in stream
    )
    aligner.start(START)
    frames, at_ns = [], START
    for arrival, key, stamp in arrivals:
        while at_ns + period < arrival:
            at_ns += period
            frames += aligner.poll(at_ns)
        aligner.push(key, stamp, value(samples[key][stamp]))
    while at_ns < START + 600 * MS:
        at_ns += period
        frames += aligner.poll(at_ns)
    check(frames, samples, method)
    for key, counts in aligner.counts.items():
        assert counts.received == len(samples[key])
        assert counts.used + counts.missing == len(frames)
        assert counts.duplicates == counts.jumped == 0
        assert counts.worst_ns <= TOLERANCE


wild = st.integers(-(10**10), 10**10)


@given(st.lists(st.tuples(st.sampled_from(["a", "b"]), wild, st.booleans()), max_size=60))
def test_no_stamp_breaks_it_and_the_memory_stays(events: list[tuple[str, int, bool]]) -> None:
    aligner = TimeAligner({key: Alignment(TOLERANCE) for key in "ab"}, RATE_HZ)
    clock, made = START, 0
    for key, offset, is_jump in events:
        if is_jump:
            clock += offset
        else:
            clock += abs(offset) % (40 * MS)
        aligner.push(key, START + offset, value(1.0))
        frames = aligner.poll(clock)
        made += len(frames)
        assert len(frames) <= 50 * (HORIZON_NS + TOLERANCE) / 1e9 + 2, "no flood after a jump"
        for frame in frames:
            assert all(abs(frame.offset_ns(name)) <= TOLERANCE for name in frame.values)
            assert {*frame.values, *frame.missing} == {"a", "b"}
    for key in "ab":
        assert sum(len(kept) for kept in aligner._cells[key].values()) <= 2 * 2 * 50 * HORIZON_NS / 1e9 + 4
        assert aligner.counts[key].used + aligner.counts[key].missing == made


def started(method: str = "nearest", **more: int) -> TimeAligner:
    aligner = TimeAligner({"a": Alignment(TOLERANCE, method)}, RATE_HZ, **more)  # type: ignore[arg-type]
    aligner.start(START)
    return aligner


def test_a_frame_waits_for_its_parts_and_goes_without_them() -> None:
    aligner = started()
    aligner.push("a", START + 1 * MS, value(1))
    assert len(aligner.poll(START + 2 * MS)) == 1, "complete, since a later sample cannot be nearer"
    assert aligner.poll(START + 20 * MS) == []
    assert aligner.poll(START + 34 * MS) == []
    (frame,) = aligner.poll(START + 35 * MS)
    assert (frame.missing, frame.values) == (("a",), {})
    aligner.push("a", START + 20 * MS, value(2))
    counts = aligner.counts["a"]
    assert (counts.late, counts.missing, counts.used) == (1, 1, 1)


def test_a_sample_that_serves_two_frames_is_counted_as_repeated() -> None:
    aligner = started()
    aligner.push("a", START + 10 * MS, value(1))
    frames = aligner.poll(START + 60 * MS)
    assert [frame.missing for frame in frames] == [(), (), ("a",)]
    assert aligner.counts["a"].repeated == 1
    assert [frame.offset_ns("a") for frame in frames[:2]] == [10 * MS, -10 * MS]


def test_duplicates_and_samples_out_of_order_are_counted() -> None:
    aligner = started()
    for offset in (5, 5, 3, 3, 9):
        aligner.push("a", START + offset * MS, value(offset))
    counts = aligner.counts["a"]
    assert (counts.received, counts.duplicates, counts.out_of_order) == (5, 2, 1)
    (frame,) = aligner.poll(START)
    assert frame.stamps_ns["a"] == START + 3 * MS


def test_a_stamp_from_another_clock_is_dropped_and_counted() -> None:
    aligner = started()
    aligner.push("a", START + 2 * HORIZON_NS, value(1))
    aligner.push("a", START - 2 * HORIZON_NS, value(1))
    aligner.push("a", START, value(2))
    assert aligner.counts["a"].jumped == 2
    (frame,) = aligner.poll(START)
    assert frame["a"].tolist() == [2, -2]


@pytest.mark.parametrize("hours", [1, -1])
def test_the_grid_begins_anew_where_the_clock_jumps(hours: int) -> None:
    aligner = started()
    aligner.poll(START + 100 * MS)
    later = START + hours * 3600 * 1_000_000_000
    assert aligner.poll(later) == []
    assert aligner.jumps == 1
    assert aligner.skipped == (pytest.approx(3600 * 50, abs=10) if hours > 0 else 0)
    aligner.push("a", later + 20 * MS, value(1))
    frames = aligner.poll(later + 20 * MS)
    assert [frame.missing for frame in frames] == [("a",), ()][-len(frames) :] or frames[-1].missing == ()


def test_it_starts_with_what_came_shortly_before() -> None:
    aligner = TimeAligner({"a": Alignment(TOLERANCE)}, RATE_HZ)
    aligner.push("a", START - 3 * MS, value(1))
    frames = aligner.poll(START) + aligner.poll(START + 15 * MS)
    assert [frame.offset_ns("a") for frame in frames] == [-3 * MS]
    aligner.stop()
    aligner.push("a", START + 9_000 * MS, value(2))
    aligner.start(START + 9_000 * MS)
    assert [frame["a"][0] for frame in aligner.poll(START + 9_000 * MS)] == [2]


def test_a_policy_takes_the_newest_of_each() -> None:
    aligner = TimeAligner({key: Alignment(TOLERANCE) for key in "abc"}, RATE_HZ)
    aligner.push("a", START - 1 * MS, value(1))
    aligner.push("b", START - 16 * MS, value(2))
    frame = aligner.newest(START)
    assert frame.missing == ("b", "c")
    assert (frame["a"][0], frame.offset_ns("a")) == (1, -1 * MS)


def test_floats_are_interpolated_and_pictures_are_not() -> None:
    picture = Feature.picture("observation.images.top", 2, 2)
    features = {
        STATE: Feature.joints(STATE, ("a",)),
        ACTION: Feature("n", "int64", (1,)),
        picture.key: picture,
    }
    aligner = TimeAligner(
        {
            key: Alignment(100 * MS, "interpolated" if feature.dtype.startswith("float") else "nearest")
            for key, feature in features.items()
        },
        10.0,
    )
    aligner.start(START)
    for key in features:
        for offset, number in ((-40, 0), (60, 10)):
            aligner.push(key, START + offset * MS, np.array([number], np.float32))
    (frame,) = aligner.poll(START + 60 * MS)
    assert [frame[key].tolist() for key in features] == [[4.0], [0], [0]]
    assert frame[STATE].dtype == np.float32


@pytest.mark.parametrize(("rate", "tolerance"), [(0.0, 1), (-1.0, 1), (float("inf"), 1), (50.0, 0)])
def test_rates_and_tolerances_are_positive(rate: float, tolerance: int) -> None:
    with pytest.raises(ValueError, match="above zero"):
        TimeAligner({"a": Alignment(tolerance)}, rate)


def test_thirty_frames_a_second_do_not_drift() -> None:
    aligner = TimeAligner({}, 30.0)
    aligner.start(START)
    frames = [frame for second in range(3) for frame in aligner.poll(START + second * 1_000_000_000)]
    assert len(frames) == 61
    assert frames[-1].stamp_ns == START + 2_000_000_000


def test_a_slow_rate_loses_no_sample() -> None:
    aligner = TimeAligner({"a": Alignment(TOLERANCE)}, 0.1)
    aligner.start(START)
    frames = []
    for k in range(2501):
        aligner.push("a", START + 10 * MS * k, value(k))
        frames += aligner.poll(START + 10 * MS * k)
    assert [frame["a"][0] for frame in frames] == [0, 1000, 2000]
    assert aligner.counts["a"].jumped == 0


def test_samples_may_come_on_other_threads() -> None:
    aligner = started(wait_ns=0)
    threads = [
        threading.Thread(
            target=lambda n=n: [aligner.push("a", START + (3 * k + n) * MS, value(k)) for k in range(300)]
        )
        for n in range(3)
    ]
    for thread in threads:
        thread.start()
    frames = [frame for k in range(1000) for frame in aligner.poll(START + k * MS)]
    for thread in threads:
        thread.join()
    assert len(frames) == 50
    assert aligner.counts["a"].received == 900
