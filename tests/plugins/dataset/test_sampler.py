"""The frames of an episode: what is dropped, held or ends it."""

from __future__ import annotations

import time
from typing import Any

import numpy as np
import pytest
from joshua.api.nodes import TopicSpec, TrafficFigures
from joshua.features import Feature, Frame
from joshua.messages import message_class
from joshua.messages.make import image, joint_state
from joshua_dataset.sampler import Sampler
from joshua_dataset.settings import StoreSettings
from joshua_dataset.streams import CLOCK_SAMPLES, Stream

T0 = 1_700_000_000_000_000_000
PERIOD = 50_000_000


def feature(key: str) -> Feature:
    return Feature.joints(key, ("pan",), topic=f"/{key}")


class Cell:
    """A recorder's streams and sampler at 20 Hz, fed and polled at times of the test's own."""

    def __init__(self, *keys: str, extra: tuple[Feature, ...] = (), **settings: Any) -> None:
        self.streams = {item.key: Stream(item) for item in (*map(feature, keys), *extra)}
        self.sampler = Sampler(self.streams.values(), StoreSettings(folder="/data", fps=20, **settings), T0)

    def feed(self, key: str, at_ns: int, value: float = 0.0) -> None:
        stream = self.streams[key]
        stream.take(joint_state(("pan",), [value], at_ns=T0 + at_ns), T0 + at_ns)
        self.sampler.push(key, T0 + at_ns, np.array([value], np.float32))

    def run(self, seconds: float, *keys: str, start_s: float = 0.0, shift_s: float = 0.0) -> list[Frame]:
        frames: list[Frame] = []
        first = round(start_s * 20)
        for number in range(first, first + round(seconds * 20)):
            for key in keys:
                self.feed(key, number * PERIOD + round(shift_s * 1e9), number)
            frames += self.sampler.poll(T0 + number * PERIOD)
            if self.sampler.over or self.sampler.failed:
                break
        return frames


def test_a_complete_recording_goes_on() -> None:
    cell = Cell("observation.state", "action")
    frames = cell.run(3, "observation.state", "action")
    assert len(frames) >= 55
    assert (cell.sampler.over, cell.sampler.counts["dropped"]) == ("", 0)
    assert all(not frame.missing for frame in cell.sampler.rest(T0 + 3_000_000_000))


@pytest.mark.parametrize(("missing", "kept"), [("drop", 0), ("hold", 10)])
def test_a_feature_that_stays_away_ends_the_episode(missing: str, kept: int) -> None:
    cell = Cell("observation.state", "action", missing=missing)
    before = cell.run(1, "observation.state", "action")
    cell.streams["action"].seen_s = time.monotonic() - 5
    after = cell.run(3, "observation.state", start_s=1)
    assert len(before) >= 15
    assert len(after) >= kept
    assert cell.sampler.over.startswith("action is lost: no message received on /action for 5.")
    assert cell.sampler.counts["dropped" if missing == "drop" else "held"] >= 18


def test_a_gap_shorter_than_a_second_ends_nothing() -> None:
    cell = Cell("observation.state", "action")
    cell.run(1, "observation.state", "action")
    cell.run(0.8, "observation.state", start_s=1)
    cell.run(2, "observation.state", "action", start_s=1.8)
    assert cell.sampler.over == ""
    assert 10 <= cell.sampler.counts["dropped"] <= 20


def test_an_action_is_the_command_in_the_middle_of_the_period_after_the_frame() -> None:
    cell = Cell("observation.state", "action")
    frames = cell.run(0.5, "observation.state", "action")
    for number in range(10, 40):
        cell.feed("observation.state", number * PERIOD, number)
        for part in (0.1, 0.4, 0.8):  # the robot takes its command for this frame at 0.4
            cell.feed("action", round((number + part) * PERIOD), number + part)
        frames += cell.sampler.poll(T0 + number * PERIOD)
    frames = [frame for frame in frames if frame.stamp_ns >= T0 + 10 * PERIOD]
    assert len(frames) > 20
    for frame in frames:
        number = round((frame.stamp_ns - T0) / PERIOD)
        assert frame.values["observation.state"] == pytest.approx([number])
        assert frame.values["action"] == pytest.approx([number + 0.4])
        assert frame.offset_ns("action") == pytest.approx(0.4 * PERIOD)
    assert cell.sampler.counts["worst_alignment_ns"] <= PERIOD // 2
    cell.feed("observation.state", 40 * PERIOD)
    cell.feed("action", round(40.4 * PERIOD))
    (last,) = cell.sampler.rest(T0 + 40 * PERIOD)
    assert last.offset_ns("action") == pytest.approx(0.4 * PERIOD)


def test_the_policy_fail_discards_the_episode() -> None:
    cell = Cell("observation.state", "action", missing="fail")
    cell.run(1, "observation.state", "action")
    cell.run(1, "observation.state", start_s=1)
    assert cell.sampler.failed == "no value of action"


def test_a_jump_of_the_clock_ends_the_episode() -> None:
    cell = Cell("observation.state")
    cell.run(1, "observation.state")
    frames = list(cell.sampler.poll(T0 + 3600 * 10**9))
    assert frames == []
    assert cell.sampler.over == "the clock of this machine jumped"


def test_a_host_whose_clock_is_off_is_named() -> None:
    cell = Cell("observation.state", "action")
    cell.run(1, "observation.state", "action")
    for number in range(20, 60):  # the host of the camera sets its clock by a second
        cell.feed("observation.state", number * PERIOD)
        cell.feed("action", number * PERIOD - 10**9)
        list(cell.sampler.poll(T0 + number * PERIOD))
    assert cell.sampler.over.startswith("action is lost: messages on /action have stamps 1.0")
    assert "s behind this machine. Synchronise the clocks of the hosts" in cell.sampler.over


@pytest.mark.parametrize(
    ("offsets_ms", "worst_ms"),
    [((20,), 1), ((20, 20), 1), ((20, 30), 5.5), ((2, 48), 2.5), ((45, 5, 25), 25.5)],
)
def test_frames_stand_where_the_pictures_are(offsets_ms: tuple[int, ...], worst_ms: float) -> None:
    cameras = [
        Feature.picture(f"observation.images.{n}", 2, 2, topic=f"/{n}") for n in range(len(offsets_ms))
    ]
    streams = [Stream(camera) for camera in cameras]
    for stream, offset_ms in zip(streams, offsets_ms, strict=True):
        for number in range(-30, 0):
            stream.take(joint_state((), ()), T0 + number * PERIOD)  # no picture: only its time counts
            stream._stamps[-1] = T0 + number * PERIOD + offset_ms * 1_000_000
    sampler = Sampler(streams, StoreSettings(folder="/data", fps=20), T0)
    frames: list[Frame] = []
    for number in range(60):
        for stream, offset_ms in zip(streams, offsets_ms, strict=True):
            sampler.push(stream.feature.key, T0 + number * PERIOD + offset_ms * 1_000_000, np.zeros(1))
        frames += sampler.poll(T0 + number * PERIOD)
    assert len(frames) > 30
    worst_ns = max(abs(frame.offset_ns(key)) for frame in frames for key in frame.values)
    assert worst_ns / 1e6 <= worst_ms


def late(stream: Stream, delay_s: float, count: int = CLOCK_SAMPLES) -> None:
    for number in range(count):
        jitter_ns = (number % 7) * 1_000_000
        message = joint_state(("pan",), [0.0], at_ns=T0 + number * PERIOD)
        stream.take(message, T0 + number * PERIOD + round(delay_s * 1e9) + jitter_ns)


@pytest.mark.parametrize(
    ("delay_s", "expected"),
    [
        (0.002, ""),
        (0.08, ""),
        (0.2, "the stamps of /action are 0.200 s behind this machine"),
        (-0.3, "the stamps of /action are 0.300 s ahead of this machine, the tolerance is 0.050 s."),
        (0.6, "the stamps of /action are 0.600 s behind this machine"),
    ],
)
def test_the_clock_of_another_host_is_estimated(delay_s: float, expected: str) -> None:
    stream = Stream(feature("action"))
    late(stream, delay_s, CLOCK_SAMPLES - 1)
    assert stream.clock_warning(0.05) == ""  # not known yet
    late(stream, delay_s)
    assert stream.delay_s == pytest.approx(delay_s)
    warning = stream.clock_warning(0.05)
    assert warning.startswith(expected)
    assert bool(warning) == bool(expected)
    assert ("chrony or NTP" in warning) == bool(expected)
    assert stream.clock_warning(0.05) == ""  # once


@pytest.mark.parametrize(
    ("delay_s", "transit_s", "expected"),
    [
        (0.06, 0.004, ""),
        (0.24, 0.004, ""),  # the camera is slow, and its clock correct
        (0.24, 0.2, "the stamps of /top are 0.200 s behind this machine, the tolerance is 0.050 s. Sync"),
        (0.15, 0.11, ""),  # a large picture on a slow network
        (0.24, None, ""),  # by another program that sends no time: may be slow, too
        (0.4, None, "the stamps of /top are 0.400 s behind this machine"),
        (0.4, 0.004, "messages on /top arrive 0.400 s after their stamps, and frames wait 0.300 s for them."),
        (-0.2, -0.24, "the stamps of /top are 0.200 s ahead of this machine"),
    ],
)
def test_a_camera_that_is_slow_is_told_from_a_clock_that_is_behind(
    delay_s: float, transit_s: float | None, expected: str
) -> None:
    stream = Stream(Feature.picture("observation.images.top", 480, 640, topic="/top"))
    stream.traffic = TrafficFigures(
        TopicSpec(name="/top", type_name="sensor_msgs/msg/Image"), is_publisher=False
    )
    for number in range(CLOCK_SAMPLES):
        at_ns = T0 + number * PERIOD
        stream.take(image(np.zeros((480, 640, 3), np.uint8), at_ns=at_ns), at_ns + round(delay_s * 1e9))
        if transit_s is not None:
            stream.traffic.transits_ns.append(round(transit_s * 1e9) + number % 7 * 1_000_000)
    warning = stream.clock_warning(0.05)
    assert warning.startswith(expected)
    assert bool(warning) == bool(expected)
    assert ("chrony or NTP" in warning) == ("this machine" in expected)


@pytest.mark.parametrize(
    ("ahead_s", "expected"),
    [
        (0.5, ""),  # the simulation runs faster than time
        (
            1.8e9,
            "the stamps of /action are 1.8e+09 s ahead of the simulated time: the node that publishes it",
        ),
    ],
)
def test_in_simulated_time_only_another_clock_is_named(ahead_s: float, expected: str) -> None:
    stream = Stream(feature("action"))
    for number in range(CLOCK_SAMPLES):
        at_ns = round((number * 0.02 + ahead_s) * 1e9)
        stream.take(joint_state(("pan",), [0.0], at_ns=at_ns), number * 20_000_000)
    warning = stream.clock_warning(0.05, simulated=True)
    assert warning.startswith(expected)
    assert bool(warning) == bool(expected)


def test_what_holds_until_it_changes_is_a_column_of_its_own() -> None:
    flag = Feature("intervention", "bool", (1,), ("intervention",), topic="/follower/intervention")
    cell = Cell("observation.state", extra=(flag,))
    frames = cell.run(1, "observation.state")
    on = message_class("std_msgs/msg/Bool")(data=True)
    cell.streams["intervention"].take(on, T0 + 10**9)
    frames += cell.run(1, "observation.state", start_s=1)
    marked = [bool(frame["intervention"][0]) for frame in frames]
    assert marked.index(True) == next(i for i, frame in enumerate(frames) if frame.stamp_ns >= T0 + 10**9)
    assert all(marked[marked.index(True) :])
    assert cell.sampler.over == ""
