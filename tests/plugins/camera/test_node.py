"""The camera's node: warnings, figures, the last picture, reconnection."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from camera_settings import make_settings
from joshua.guardian.silence import AwakeClock
from joshua.messages.make import pixels
from joshua.plan import NodeKind, NodeSpec, TopicSpec
from joshua.testing.recording_context import RecordingContext
from joshua_camera import node as node_module
from joshua_camera.camera import CAMERA_INFO, COMPRESSED_IMAGE, IMAGE
from joshua_camera.figures import Figures
from joshua_camera.node import CameraNode
from joshua_camera.picture import decode_jpeg
from joshua_emulator import EmulatedCamera
from joshua_emulator.camera.frame_code import read_code

Runner = Callable[..., tuple[CameraNode, RecordingContext]]


def wait_until(condition: Callable[[], bool]) -> None:
    deadline_s = time.monotonic() + 30
    while not condition():
        assert time.monotonic() < deadline_s
        time.sleep(0.005)


@pytest.fixture
def run() -> Iterator[Runner]:
    started: list[tuple[CameraNode, RecordingContext]] = []

    def start(
        source: str, types: tuple[str, ...] = (IMAGE,), *, testing: bool = True, **fields: Any
    ) -> tuple[CameraNode, RecordingContext]:
        settings = make_settings(types, source=source, **fields)
        spec = NodeSpec(
            name="camera_top",
            namespace="/rig",
            frame_id="camera_top",
            kind=NodeKind.SENSOR,
            behaviour="joshua_camera.node:CameraNode",
            implementation="joshua_camera.camera:OpenCvCamera",
            settings_type="joshua_camera.settings:CameraSettings",
            settings=settings.model_dump(mode="json"),
            facts={"testing": True} if testing else {},
            publishers=tuple(
                TopicSpec(name=f"/{index}", type_name=name, rate_hz=settings.fps)
                for index, name in enumerate(types)
            ),
        )
        context = RecordingContext(spec)
        node = CameraNode(context)
        started.append((node, context))
        node.configure()
        node.activate()
        return node, context

    yield start
    for node, context in started:
        stop(node, context)


def stop(node: CameraNode, context: RecordingContext) -> None:
    context._stop.set()
    node.deactivate()
    context.stop()
    node.cleanup()


def test_every_type_carries_the_same_picture(emulator: EmulatedCamera, run: Runner) -> None:
    _, context = run(emulator.source, (IMAGE, COMPRESSED_IMAGE, CAMERA_INFO))
    outputs = [context.publishers[f"/{index}"].messages for index in range(3)]
    wait_until(lambda: all(len(messages) > 3 for messages in outputs))
    images, compressed, infos = outputs
    jpeg = {message.header.stamp.nanosec: message for message in compressed}
    shared = next(message for message in images if message.header.stamp.nanosec in jpeg)
    decoded = decode_jpeg(jpeg[shared.header.stamp.nanosec].data.tobytes())
    assert decoded is not None
    assert read_code(decoded) == read_code(pixels(shared))
    assert infos[0].header.frame_id == "camera_top"
    assert context.warnings == ["CAMERA_INFO contains no calibration: set intrinsics_file"]


def test_a_test_ends_with_results_and_a_picture(
    emulator: EmulatedCamera, run: Runner, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("JOSHUA_LOG_DIR", str(tmp_path / "log"))
    node, context = run(emulator.source)
    wait_until(lambda: len(context.publishers["/0"].messages) >= 60)
    stop(node, context)
    rows = {name: (passed, text) for name, passed, text in node.test_results()}
    assert rows["settings kept"] == (True, "all")
    assert rows["pictures whole"][0]
    assert "0 damaged" in rows["pictures whole"][1]
    assert rows["latency"][1].startswith("median ")
    assert rows["frame rate"][1].endswith("Hz of 60 Hz") or "poor light" in rows["frame rate"][1]
    assert rows["picture has content"][0]
    passed, path = rows["last picture"]
    assert passed
    assert Path(path).name.startswith("rig_camera_top-")
    decoded = decode_jpeg(Path(path).read_bytes())
    assert decoded is not None
    assert read_code(decoded) is not None


def test_a_picture_that_cannot_be_written_is_a_failed_row(
    emulator: EmulatedCamera, run: Runner, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "file").touch()
    monkeypatch.setenv("JOSHUA_LOG_DIR", str(tmp_path / "file" / "log"))
    node, context = run(emulator.source)
    wait_until(lambda: len(context.publishers["/0"].messages) >= 2)
    stop(node, context)
    rows = {name: (passed, text) for name, passed, text in node.test_results()}
    passed, text = rows["last picture"]
    assert not passed
    assert "not a directory" in text


def test_a_covered_lens_fails_the_test(run: Runner, tmp_path: Path) -> None:
    for number in range(3):
        cv2.imwrite(str(tmp_path / f"{number:04d}.png"), np.full((240, 320, 3), 4, np.uint8))
    node, context = run(str(tmp_path / "%04d.png"))
    wait_until(lambda: len(context.publishers["/0"].messages) >= 2)
    stop(node, context)
    rows = {name: (passed, text) for name, passed, text in node.test_results()}
    assert rows["picture has content"] == (
        False,
        "every pixel is near 4 of 255: check whether the lens is covered or the exposure is wrong",
    )


def test_settings_without_effect_are_warnings(emulator: EmulatedCamera, run: Runner) -> None:
    node, context = run(emulator.source, brightness=3)
    assert context.warnings == [
        f"brightness: no effect on {emulator.source}; set it on the camera's own page"
    ]
    rows = {name: (passed, text) for name, passed, text in node.test_results()}
    assert rows["settings kept"] == (True, "all")


def test_figures_are_logged(emulator: EmulatedCamera, run: Runner, caplog: pytest.LogCaptureFixture) -> None:
    _, context = run(emulator.source)
    wait_until(lambda: len(context.publishers["/0"].messages) >= 10)
    with caplog.at_level(logging.DEBUG):
        context.tick("figures")
    assert "Hz" in caplog.messages[-1]
    assert "0 damaged" in caplog.messages[-1]
    assert caplog.records[-1].levelno == logging.INFO


def test_outside_a_test_there_are_no_further_results(emulator: EmulatedCamera, run: Runner) -> None:
    node, _ = run(emulator.source, testing=False)
    assert "last picture" not in [name for name, _, _ in node.test_results()]


def test_an_unplugged_camera_comes_back(emulator: EmulatedCamera, run: Runner) -> None:
    _, context = run(emulator.source)
    messages = context.publishers["/0"].messages
    wait_until(lambda: len(messages) > 2)
    first = emulator.log("plug")[-1]["sequence"]
    emulator.fault("unplug", replug_after_s=0.3)
    emulator.wait_for(["plug"], since=first)
    count = len(messages)
    wait_until(lambda: len(messages) > count + 5)
    numbers = [found.number for message in messages if (found := read_code(pixels(message)))]
    assert numbers == sorted(set(numbers))
    stamps = [(message.header.stamp.sec, message.header.stamp.nanosec) for message in messages]
    assert stamps == sorted(set(stamps))


def test_the_stop_does_not_wait_for_a_connection_attempt(emulator: EmulatedCamera, run: Runner) -> None:
    node, context = run(emulator.source)
    messages = context.publishers["/0"].messages
    wait_until(lambda: len(messages) > 2)
    emulator.fault("unplug")
    emulator.fault("stall")
    emulator.fault("replug")
    wait_until(lambda: emulator.ask("state")["streams"] > 0)  # the node connects, and gets no picture
    stop(node, context)


def test_a_window_needs_a_display(
    emulator: EmulatedCamera, run: Runner, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    _, context = run(emulator.source, display=True)
    assert context.warnings == [
        "display: no window, because this machine has no display; over SSH, log in with ssh -X"
    ]


@pytest.mark.parametrize(("held_ns", "passed"), [(500_000_000, True), (0, False)])
def test_a_machine_that_stood_still_is_no_fault_of_the_camera(
    monkeypatch: pytest.MonkeyPatch, held_ns: int, passed: bool
) -> None:
    now_ns = [0]
    held = AwakeClock(lambda: now_ns[0] / 1e9, 0.04)
    now_ns[0] = held_ns + 20_000_000
    held.now_s()
    monkeypatch.setattr(node_module, "witness", lambda: held)
    figures = Figures(24.0, 60, 60, 0, 0, 0, 0.0, 0.0, "", "", span_ns=(0, 2_500_000_000))
    assert node_module._rate(figures, 30.0)[1] is passed
