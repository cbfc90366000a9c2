"""Data sets of ROS 2 messages, read back by another library; and exports for other viewers."""

from __future__ import annotations

import argparse
import contextlib
import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from joshua.features import DatasetLayout, EpisodeError, Feature, FeatureSet, Frame
from joshua.messages import encode
from joshua.messages.make import image, joint_state
from joshua.tools import install
from joshua_dataset import export as exporting
from joshua_dataset.bag import Bag, messages
from joshua_dataset.commands import dataset as command
from joshua_dataset.mcap_writer import McapWriter
from joshua_dataset.reader import Dataset, DatasetError
from joshua_dataset.repair import repair
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rosbags.rosbag2 import Reader
from rosbags.typesys import Stores, get_typestore
from small_dataset import TOP, layout, write

NAMES = ("pan", "gripper")
T0 = 1_700_000_000_000_000_000


def played(folder: Path) -> list[tuple[str, int, Any]]:
    """Topic, time and message as an unmodified rosbag2 reader of another library sees them."""
    store = get_typestore(Stores.ROS2_JAZZY)
    with Reader(folder) as reader:
        return [
            (connection.topic, stamp_ns, store.deserialize_cdr(data, connection.msgtype))
            for connection, stamp_ns, data in reader.messages()
        ]


def bag_of(folder: Path, episode: int = 0) -> Path:
    return list(Dataset.read(folder).episode_list())[episode].table


def add(writer: McapWriter, count: int, start_ns: int = T0) -> None:
    for number in range(count):
        at_ns = start_ns + number * 20_000_000
        writer.add_message(
            "/arm/joint_states", joint_state(NAMES, [number, 1], at_ns=at_ns), at_ns + 500, at_ns
        )


def test_messages_are_read_back_by_rosbags(tmp_path: Path) -> None:
    with contextlib.closing(McapWriter(layout(tmp_path / "set"))) as writer:
        writer.open()
        add(writer, 30)
        picture = np.arange(24 * 32 * 3, dtype=np.uint8).reshape(24, 32, 3)
        writer.add_message("/top/image_raw", image(picture, at_ns=T0), T0 + 1, T0)
        assert (writer.open_frames, round(writer.open_s, 2)) == (31, 0.58)
        writer.end_episode("wave", {})
        add(writer, 5)
        writer.end_episode("point")
    found = Dataset.read(tmp_path / "set")
    assert (found.format, found.episodes, found.frames, found.tasks) == ("mcap", 2, 36, ("wave", "point"))
    seen = played(bag_of(tmp_path / "set"))
    states = [(at_ns, message) for topic, at_ns, message in seen if topic == "/arm/joint_states"]
    assert [message.position.tolist() for _, message in states] == [[number, 1] for number in range(30)]
    assert states[1][0] == T0 + 20_000_500
    assert states[1][1].header.stamp.nanosec == 20_000_000
    (shown,) = [message for topic, _, message in seen if topic == "/top/image_raw"]
    assert np.array_equal(shown.data.reshape(24, 32, 3), picture)
    assert len(played(bag_of(tmp_path / "set", 1))) == 5
    # by the schemas in the file, as Foxglove's own reader does it
    with (bag_of(tmp_path / "set") / "messages.mcap").open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        theirs = [item for *_, item in reader.iter_decoded_messages("/arm/joint_states")]
        (shown,) = [item for *_, item in reader.iter_decoded_messages("/top/image_raw")]
    assert [list(item.position) for item in theirs] == [[number, 1] for number in range(30)]
    assert np.array_equal(np.frombuffer(shown.data, np.uint8).reshape(24, 32, 3), picture)


def test_the_file_has_schemas_and_chunks_for_a_viewer(tmp_path: Path) -> None:
    bag = Bag(tmp_path / "bag")
    bag.add("/a", "sensor_msgs/msg/JointState", b"\0\1\0\0", T0, T0)
    bag.close()
    with (tmp_path / "bag/messages.mcap").open("rb") as file:
        reader = make_reader(file)
        (schema,) = reader.get_summary().schemas.values()
        assert reader.get_header().profile == "ros2"
    assert (schema.name, schema.encoding) == ("sensor_msgs/msg/JointState", "ros2msg")
    assert schema.data.decode().startswith("std_msgs/Header header\nstring[] name\n")
    assert "MSG: builtin_interfaces/Time" in schema.data.decode()


def test_a_kill_costs_the_last_messages_of_the_open_episode_alone(tmp_path: Path) -> None:
    child = os.fork()
    if not child:
        writer = McapWriter(layout(tmp_path / "set"))
        writer.task = "wave"
        writer.open()
        add(writer, 20)
        writer.end_episode("wave")
        add(writer, 200)
        writer._bag._file.flush()
        os._exit(0)  # as a kill does: nothing is closed
    assert os.waitpid(child, 0)[1] == 0
    assert len(played(bag_of(tmp_path / "set"))) == 20
    with pytest.raises(EpisodeError, match="left unfinished"):
        McapWriter(layout(tmp_path / "set", resume=True)).open()
    assert "\nepisode 1 is completed (3." in str(repair(tmp_path / "set"))
    assert 180 <= len(played(bag_of(tmp_path / "set", 1))) <= 200
    assert Dataset.read(tmp_path / "set").episodes == 2
    with pytest.raises(EpisodeError, match=r"cannot be mended .*no message of /action"):
        repair(tmp_path / "set")  # this test records no message for the features


def test_an_episode_without_a_whole_message_is_moved_aside(tmp_path: Path) -> None:
    writer = McapWriter(layout(tmp_path / "set"))
    writer.open()
    add(writer, 1)
    writer._bag.drop()
    writer._lock.release()
    (said,) = repair(tmp_path / "set").lines
    assert "episode 0 cannot be completed: no message of it is whole. Its files were moved to " in said
    assert (Path(said.rpartition(" ")[2]) / "bag" / "messages.mcap").is_file()


def test_tools_for_frames_say_what_it_is(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with contextlib.closing(McapWriter(layout(tmp_path / "set"))) as writer:
        writer.open()
        add(writer, 3)
        writer.end_episode("wave")
    assert run("info", str(tmp_path / "set")) == 0
    assert "layout: mcap   pictures: messages" in capsys.readouterr().out
    assert run("stats", str(tmp_path / "set")) == 1
    expected = (
        f"frames. Convert it to frames with `joshua dataset convert {tmp_path / 'set'} TARGET`, or open"
    )
    assert expected in capsys.readouterr().err


class Cell:
    """An episode of messages as a robot publishes them: joints at 50 Hz, commands at 40, pictures at 10."""

    def __init__(self, folder: Path) -> None:
        units = "pan:-1.0000:1.0000 lift:-2.0000:2.0000"
        named = ("pan.pos", "lift.pos")
        self.layout = DatasetLayout(
            folder,
            "so101_follower",
            10,
            FeatureSet(
                [
                    Feature.joints("observation.state", named, unit="lerobot", topic="/arm/joint_states"),
                    Feature.joints("action", named, unit="lerobot", topic="/arm/applied_command"),
                    Feature.picture(TOP, 24, 32, topic="/top/image_raw"),
                    Feature("acquisition_ns", "int64", (3,), ("observation.state", "action", TOP), "ns"),
                ]
            ),
            identity={f"calibration of {key}": units for key in ("observation.state", "action")},
            counters=("dropped", "held", "worst_alignment_ns"),
        )

    def record(self, *lengths_s: float) -> None:
        with contextlib.closing(McapWriter(self.layout)) as writer:
            writer.open()
            for length_s in lengths_s:
                for at_ms in range(0, round(1000 * length_s), 5):
                    at_ns = T0 + at_ms * 1_000_000
                    for topic, period_ms in (("/arm/joint_states", 20), ("/arm/applied_command", 25)):
                        if at_ms % period_ms == 0:  # a joint that moves by 0.1 rad/s
                            message = joint_state(("lift", "pan"), [0.0, at_ms / 1e4], at_ns=at_ns)
                            writer.add_message(topic, message, at_ns + 3_000_000, at_ns)
                    if at_ms % 100 == 0:
                        shade = np.full((24, 32, 3), at_ms // 20, np.uint8)
                        writer.add_message(
                            "/top/image_raw", image(shade, at_ns=at_ns), at_ns + 9_000_000, at_ns
                        )
                writer.end_episode("wave", {"dropped": 0})


def test_frames_are_made_of_messages(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    cell = Cell(tmp_path / "set")
    cell.record(3.0, 2.0)
    assert run("check", str(tmp_path / "set"), "--workers", "1") == 0
    assert "0 errors, 0 warnings" in capsys.readouterr().out
    assert run("convert", str(tmp_path / "set"), str(tmp_path / "frames")) == 0
    made = Dataset.read(tmp_path / "frames")
    assert (made.episodes, made.tasks, made.pictures, made.version) == (2, ("wave",), "video", "v3.0")
    first, _ = made.episode_list()
    columns = made.columns(first)
    assert first.length >= 25
    assert first.counts["dropped"] == 0
    assert np.all(np.diff(columns["stamp_ns"]) == 100_000_000)
    # 0.1 rad/s is 10 % of a range of 2 rad a second. The state lies between two messages; the action is the
    # command nearest to the middle of the period of 0.1 s that the frame begins.
    elapsed_s = (columns["stamp_ns"] - T0) / 1e9
    assert columns["observation.state"][:, 0] == pytest.approx(10 * elapsed_s, abs=1e-3)
    assert columns["action"][:, 0] == pytest.approx(10 * (elapsed_s + 0.05), abs=0.13)
    apart_ms = (columns["acquisition_ns"] - columns["stamp_ns"][:, None]) / 1e6
    assert apart_ms[:, 1] == pytest.approx(50.0, abs=12.5)
    assert np.abs(apart_ms[:, (0, 2)]).max() <= 50.0
    shades = [int(picture.mean()) for picture in made.decoded(first, TOP)]
    assert shades == pytest.approx(list(50 * elapsed_s), abs=3)
    assert run("check", str(tmp_path / "frames"), "--workers", "1") == 0
    assert run("convert", str(tmp_path / "set"), str(tmp_path / "csv"), "--format", "csv") == 0
    assert run("merge", str(tmp_path / "set"), str(tmp_path / "frames"), "--into", str(tmp_path / "x")) == 1
    assert (
        "contains messages, but another data set contains frames: convert it before"
        in capsys.readouterr().err
    )


def test_episodes_of_messages_are_deleted(tmp_path: Path) -> None:
    cell = Cell(tmp_path / "set")
    cell.record(0.5, 1.0)
    before = played(bag_of(tmp_path / "set", 1))
    topics = Dataset.read(tmp_path / "set").topics
    assert run("delete", str(tmp_path / "set"), "--episodes", "0") == 0
    left = Dataset.read(tmp_path / "set")
    assert (left.episodes, left.frames, left.topics) == (1, len(before), topics)
    assert [item[:2] for item in played(bag_of(tmp_path / "set"))] == [item[:2] for item in before]


def test_what_is_wrong_with_messages_is_found(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    cell = Cell(tmp_path / "set")
    cell.record(0.5, 0.5)
    bag = Bag(tmp_path / "other")
    for at_ms in (0, 20, 40, 60, 2000, 2020):
        message = joint_state(("pan", "lift"), [0.0, 0.0], at_ns=T0 + at_ms * 1_000_000)
        bag.add("/arm/joint_states", type(message).__msgtype__, encode(message), T0 + at_ms * 1_000_000, T0)
    bag.close()
    (tmp_path / "other/messages.mcap").replace(bag_of(tmp_path / "set") / "messages.mcap")
    (bag_of(tmp_path / "set", 1) / "messages.mcap").unlink()
    assert run("check", str(tmp_path / "set"), "--workers", "1") == 1
    said = capsys.readouterr().out
    assert "error: episode 0: messages.mcap has 6 intact messages, but 50 are described" in said
    assert "error: episode 0: it has no message of /arm/applied_command, which carries action" in said
    assert "warning: episode 0: /arm/joint_states has no message for 1.94 s" in said
    assert "messages.mcap is missing" in said


def test_a_torn_file_is_read_as_far_as_it_is_whole(tmp_path: Path) -> None:
    bag = Bag(tmp_path / "bag")
    for number in range(100):
        bag.add("/a", "std_msgs/msg/String", b"\0\1\0\0" + bytes(200), T0 + number, T0)
    bag.close()
    path = tmp_path / "bag/messages.mcap"
    data = path.read_bytes()
    path.write_bytes(data[: len(data) // 2])
    assert 20 < len(list(messages(path))) < 60
    path.write_bytes(data[:10])
    assert list(messages(path)) == []


def run(*words: str) -> int:
    parser = argparse.ArgumentParser()
    command.add_arguments(parser)
    return int(command.run(parser.parse_args(words)))


def test_an_export_makes_messages_of_frames(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write(tmp_path / "set")
    assert run("export", str(tmp_path / "set"), str(tmp_path / "out")) == 0
    assert capsys.readouterr().out == f"{tmp_path / 'out'}: 2 episodes\n"
    seen = played(bag_of(tmp_path / "out"))
    actions = [message for topic, _, message in seen if topic == "/action"]
    assert [list(message.position) for message in actions] == [[0.5, 0.0], [1.5, 0.0], [2.5, 0.0]]
    assert actions[0].name == ["pan", "lift"]
    pictures = [message for topic, _, message in seen if topic == "/observation/images/top/compressed"]
    assert len(pictures) == 3
    assert all(bytes(message.data[:2]) == b"\xff\xd8" for message in pictures)
    assert run("export", str(tmp_path / "set"), str(tmp_path / "out")) == 1
    assert "is not empty, and data sets are never overwritten" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("unit", "identity", "expected"),
    [
        ("deg", {}, [np.pi, 0.0]),
        ("lerobot", {"calibration of action": "pan:-1.0000:1.0000 gripper:0.0000:2.0000"}, [1.8, 0.0]),
    ],
)
def test_joints_are_in_radians(tmp_path: Path, unit: str, identity: Any, expected: Any) -> None:
    exported = DatasetLayout(
        tmp_path / "set",
        "arm",
        10,
        FeatureSet([Feature.joints("action", NAMES, unit=unit)]),
        identity=identity,
    )
    with contextlib.closing(McapWriter(exported)) as writer:
        writer.open()
        writer.add_frame(Frame(T0, {"action": np.array([180.0, 0.0])}))
        writer.end_episode("wave")
    ((_, _, message),) = played(bag_of(tmp_path / "set"))
    assert message.position == pytest.approx(expected)


def test_positions_without_a_calibration_stay_numbers(tmp_path: Path) -> None:
    features = FeatureSet([Feature.joints("action", NAMES, unit="lerobot")])
    with contextlib.closing(McapWriter(DatasetLayout(tmp_path / "set", "arm", 10, features))) as writer:
        writer.open()
        writer.add_frame(Frame(T0, {"action": np.array([50.0, 7.0])}))
        writer.end_episode("wave")
    ((_, _, message),) = played(bag_of(tmp_path / "set"))
    assert message.data.tolist() == [50.0, 7.0]
    assert message.layout.dim[0].label == "pan, gripper"


def test_rerun_is_named_where_it_is_missing(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    write(tmp_path / "set")
    monkeypatch.setattr(exporting, "importlib", _Absent)
    assert run("export", str(tmp_path / "set"), str(tmp_path / "out"), "--to", "rerun") == 1
    assert "an export to Rerun requires rerun-sdk: " in capsys.readouterr().err
    assert "dataset[rerun]" in install("joshua-dataset", "rerun")


class _Absent:
    @staticmethod
    def import_module(name: str) -> Any:
        raise ImportError(name)


def test_an_export_for_rerun(tmp_path: Path) -> None:
    pytest.importorskip("rerun", reason="rerun-sdk takes 500 MB, and no session installs it")
    write(tmp_path / "set")
    assert run("export", str(tmp_path / "set"), str(tmp_path / "out"), "--to", "rerun") == 0
    files = sorted(path.name for path in (tmp_path / "out").iterdir())
    assert files == ["episode-000000.rrd", "episode-000001.rrd"]
    assert (tmp_path / "out" / files[0]).read_bytes()[:4] == b"RRF2"
    with pytest.raises(EpisodeError, match="exists: name a new folder"):
        exporting.export(tmp_path / "set", tmp_path / "out", "rerun")


def test_a_data_set_with_too_few_pictures_is_not_exported(tmp_path: Path) -> None:
    write(tmp_path / "set")
    write(tmp_path / "short", lengths=(2, 2))
    video = f"videos/{TOP}/chunk-000/file-000.mp4"
    (tmp_path / "set" / video).write_bytes((tmp_path / "short" / video).read_bytes())
    with pytest.raises(DatasetError, match=r"episode 0 of .* has fewer than 3 pictures"):
        exporting.export(tmp_path / "set", tmp_path / "out", "mcap")
    assert not (tmp_path / "out").exists()
