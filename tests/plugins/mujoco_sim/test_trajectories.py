"""Every form of recording gives the same trajectory, and each fault of a file has its message."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pyarrow
import pyarrow.parquet
import pytest
from joshua.features import DatasetLayout, Feature, FeatureSet, Frame
from joshua_dataset import writer
from joshua_mujoco_sim.trajectories import trajectory as recordings
from joshua_mujoco_sim.trajectories.reading import read_trajectories
from joshua_mujoco_sim.trajectories.trajectory import Trajectory, TrajectoryError
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

JOINTS = ("shoulder_pan", "gripper")
TIMES = np.arange(5, dtype=np.float64) * 0.1
POSITIONS = np.column_stack([np.linspace(-1, 1, 5), np.linspace(0, 0.4, 5)])
RANGES = {"shoulder_pan": (-2.0, 2.0), "gripper": (0.0, 1.0)}


def write_csv(folder: Path) -> Path:
    path = folder / "wave.csv"
    rows = [
        f"{time},{pan},{jaw}" for time, (pan, jaw) in zip(TIMES.tolist(), POSITIONS.tolist(), strict=True)
    ]
    path.write_text("\n".join([f"time_s,{','.join(JOINTS)}", *rows]) + "\n")
    return path


def write_json_lines(folder: Path) -> Path:
    path = folder / "wave.jsonl"
    with path.open("w") as file:
        for time, (pan, jaw) in zip(TIMES.tolist(), POSITIONS.tolist(), strict=True):
            file.write(json.dumps({"timestamp": time, "shoulder_pan": pan, "gripper": jaw}) + "\n")
    return path


def write_parquet(folder: Path) -> Path:
    path = folder / "wave.parquet"
    columns = {"time_s": TIMES, "shoulder_pan": POSITIONS[:, 0], "gripper": POSITIONS[:, 1]}
    pyarrow.parquet.write_table(pyarrow.table(columns), path)
    return path


def write_lerobot(folder: Path) -> Path:
    root = folder / "data set"
    (root / "meta").mkdir(parents=True)
    (root / "data" / "chunk-000").mkdir(parents=True)
    feature = {"dtype": "float32", "shape": [2], "names": list(JOINTS)}
    info = {"codebase_version": "v3.0", "fps": 10, "features": {"action": feature}}
    (root / "meta" / "info.json").write_text(json.dumps(info))
    columns = {
        "action": [*POSITIONS.tolist(), *(POSITIONS + 0.1).tolist()],
        "timestamp": [*TIMES, *TIMES],
        "episode_index": [0] * 5 + [1] * 5,
    }
    pyarrow.parquet.write_table(pyarrow.table(columns), root / "data" / "chunk-000" / "file-000.parquet")
    return root


def write_rosbag(folder: Path, storage: StoragePlugin) -> Path:
    store = get_typestore(Stores.ROS2_JAZZY)
    joint_state, header, time = (
        store.types[name]
        for name in ("sensor_msgs/msg/JointState", "std_msgs/msg/Header", "builtin_interfaces/msg/Time")
    )
    path = folder / f"bag_{storage.name.lower()}"
    with Writer(path, version=9, storage_plugin=storage) as writer:
        connection = writer.add_connection("/joint_states", joint_state.__msgtype__, typestore=store)
        for at, position in zip(TIMES, POSITIONS, strict=True):
            message = joint_state(header(time(0, 0), ""), list(JOINTS), position, np.zeros(2), np.zeros(2))
            raw = store.serialize_cdr(message, joint_state.__msgtype__)
            writer.write(connection, round(1e9 + at * 1e9), raw)
    return path


def write_mcap(folder: Path) -> Path:
    return next(write_rosbag(folder, StoragePlugin.MCAP).glob("*.mcap"))


@pytest.mark.parametrize(
    "write",
    [
        write_csv,
        write_json_lines,
        write_parquet,
        write_lerobot,
        write_mcap,
        lambda folder: write_rosbag(folder, StoragePlugin.SQLITE3),
    ],
)
def test_every_form_gives_the_same_motion(tmp_path: Path, write) -> None:
    trajectory = read_trajectories(write(tmp_path))[0]
    assert trajectory.names == JOINTS
    assert trajectory.time_s == pytest.approx(TIMES, abs=1e-6)
    assert trajectory.position == pytest.approx(POSITIONS, abs=1e-6)


def test_a_link_that_leads_out_of_a_data_set_is_not_read(tmp_path: Path) -> None:
    root = write_lerobot(tmp_path)
    file = root / "data" / "chunk-000" / "file-000.parquet"
    file.rename(tmp_path / "elsewhere.parquet")
    file.symlink_to(tmp_path / "elsewhere.parquet")
    with pytest.raises(TrajectoryError, match="is a symlink that leads outside"):
        read_trajectories(root)


def test_episodes_are_chosen_by_number(tmp_path: Path) -> None:
    root = write_lerobot(tmp_path)
    assert len(read_trajectories(root)) == 2
    (chosen,) = read_trajectories(root, (1,))
    assert chosen.position == pytest.approx(POSITIONS + 0.1, abs=1e-6)
    with pytest.raises(TrajectoryError, match=r"no episode 7: it has 0 to 1"):
        read_trajectories(root, (7,))


def test_folder_of_files_is_a_data_set_too(tmp_path: Path) -> None:
    write_csv(tmp_path).rename(tmp_path / "episode_000.csv")
    write_csv(tmp_path).rename(tmp_path / "episode_001.csv")
    assert len(read_trajectories(tmp_path)) == 2
    assert len(read_trajectories(tmp_path, (1,))) == 1
    with pytest.raises(TrajectoryError, match="2 episodes"):
        read_trajectories(tmp_path, (2,))


@pytest.mark.parametrize(
    ("name", "text", "expected"),
    [
        ("a.csv", "", "is empty: its first line names the columns"),
        ("a.csv", "time_s,gripper\n", "has no samples"),
        ("a.csv", "time_s,gripper\n0,1\n1,2,3\n", "line 3: 3 columns, and line 1 names 2"),
        ("a.csv", "time_s,gripper\n0,open\n", "line 2: gripper is 'open', and a number is needed"),
        ("a.csv", "gripper\n1\n", "no column time_s or timestamp; it has gripper"),
        ("a.csv", "time_s,gripper\n0,nan\n", "sample 1 holds a value that is not a finite number"),
        ("a.csv", "time_s,gripper\n1,0\n1,0\n", "time of sample 2 is not later"),
        ("a.csv", "time_s\n1\n", "no column of joint positions"),
        ("a.jsonl", '{"time_s": 0, "a": 1}\n{"time_s"\n', "line 2: Expecting"),
        ("a.jsonl", "[1]\n", "line 1: a JSON object is needed"),
        ("a.jsonl", '{"time_s": 0, "a": 1}\n{"time_s": 1, "b": 1}\n', "sample 2 has time_s, b"),
        ("a.csv", "time_s,a\n" + "1" * (1 << 21), "line 2: is longer than 1048576 characters"),
        ("a.jsonl", "[" * 100_000, "line 1: is no sample: "),
        ("a.jsonl", '{"time_s": ' + "1" * 5000 + "}", "line 1: "),
        ("a.jsonl", '{"time_s": 0, "a": 1' + "0" * 400 + "}", "line 1: a is 1000.*, and a number is needed"),
        (
            "a.jsonl",
            '{"time_s": 0, "action": [1, 2]}\n{"time_s": 1, "action": [1]}\n',
            "line 2: action has another length than in the first sample",
        ),
        ("a.parquet", "nothing", "cannot be read as Parquet"),
        ("a.mcap", "nothing", "cannot be read as a ROS 2 recording"),
        ("a.txt", "", r"\.txt is not a supported format: name a \.csv"),
    ],
)
def test_each_fault_has_its_message(tmp_path: Path, name: str, text: str, expected: str) -> None:
    path = tmp_path / name
    path.write_text(text)
    with pytest.raises(TrajectoryError, match=expected):
        read_trajectories(path)


@pytest.mark.parametrize(
    "write",
    [write_csv, write_json_lines, write_parquet, write_lerobot, write_mcap],
)
def test_a_recording_that_is_too_long_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, write: Callable[[Path], Path]
) -> None:
    path = write(tmp_path)
    monkeypatch.setattr(recordings, "MOST_NUMBERS", 14)
    with pytest.raises(TrajectoryError, match=r"too long to be replayed at once: more than 14 numbers"):
        read_trajectories(path)
    monkeypatch.setattr(recordings, "MOST_NUMBERS", 40)
    assert len(read_trajectories(path)[0].time_s) == 5


def test_the_size_of_a_parquet_file_is_asked_before_it_is_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "still.parquet"  # compressed, what never changes takes no room
    still = np.zeros(2_000_000)
    table = pyarrow.table({"time_s": still, **{f"joint_{number}": still for number in range(12)}})
    pyarrow.parquet.write_table(table, path, compression="zstd")
    assert path.stat().st_size < 1_000_000
    monkeypatch.setattr(pyarrow.parquet.ParquetFile, "read", lambda *_, **__: pytest.fail("it was read"))
    with pytest.raises(TrajectoryError, match="more than 20000000 numbers"):
        read_trajectories(path)


def test_pictures_beside_the_joints_are_not_read(tmp_path: Path) -> None:
    path = tmp_path / "seen.parquet"
    table = pyarrow.table(
        {"timestamp": TIMES, "action": POSITIONS.tolist(), "picture": [b"x"] * 5, "task": ["wave"] * 5}
    )
    pyarrow.parquet.write_table(table, path)
    (trajectory,) = read_trajectories(path)
    assert trajectory.position == pytest.approx(POSITIONS)


def test_lists_of_different_lengths_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "ragged.parquet"
    table = pyarrow.table({"timestamp": [0.0, 1.0], "action": [[1.0, 2.0], [1.0]]})
    pyarrow.parquet.write_table(table, path)
    with pytest.raises(TrajectoryError, match="action has rows of different lengths"):
        read_trajectories(path)


def test_files_of_a_data_set_that_disagree_are_refused(tmp_path: Path) -> None:
    root = write_lerobot(tmp_path)
    columns = {"action": [[1.0, 2.0, 3.0]], "timestamp": [1.0], "episode_index": [1]}
    file = root / "data" / "chunk-000" / "file-001.parquet"
    pyarrow.parquet.write_table(pyarrow.table(columns), file)
    with pytest.raises(TrajectoryError, match="action has another length than in the files before it"):
        read_trajectories(root)
    pyarrow.parquet.write_table(pyarrow.table({"action": [[1.0, 2.0]], "timestamp": [1.0]}), file)
    with pytest.raises(TrajectoryError, match="has no timestamp, no episode_index or no action"):
        read_trajectories(root)


def test_missing_path_and_empty_folder(tmp_path: Path) -> None:
    with pytest.raises(TrajectoryError, match="does not exist: name a"):
        read_trajectories(tmp_path / "no.csv")
    with pytest.raises(TrajectoryError, match="is a folder without a recording"):
        read_trajectories(tmp_path)


def trajectory(*names: str, values: np.ndarray = POSITIONS) -> Trajectory:
    return Trajectory("file", names, TIMES, values)


def test_columns_find_their_joints_in_any_order() -> None:
    joints, position = trajectory("gripper", "shoulder_pan").for_joints(RANGES)
    assert joints == ("gripper", "shoulder_pan")
    assert position == pytest.approx(POSITIONS)


def test_other_columns_are_left_out() -> None:
    joints, position = trajectory("gripper", "door").for_joints(RANGES)
    assert joints == ("gripper",)
    assert position.shape == (5, 1)


def test_numbered_joints_go_by_order() -> None:
    assert trajectory("joint_1", "joint_2").for_joints(RANGES)[0] == JOINTS


def test_percent_of_lerobot_becomes_the_range() -> None:
    values = np.column_stack([np.linspace(-100, 100, 5), np.linspace(0, 100, 5)])
    _, position = trajectory("shoulder_pan.pos", "gripper.pos", values=values).for_joints(RANGES)
    assert position[:, 0] == pytest.approx(np.linspace(-2, 2, 5))
    assert position[:, 1] == pytest.approx(np.linspace(0, 1, 5))


def test_degrees_of_lerobot_are_about_the_middle_of_the_range() -> None:
    values = np.column_stack([np.linspace(-114.592, 114.592, 5), np.linspace(0, 100, 5)])
    _, position = trajectory("shoulder_pan.pos", "gripper.pos", values=values).for_joints(RANGES)
    assert position[:, 0] == pytest.approx(np.linspace(-2, 2, 5), abs=2e-3)
    assert position[:, 1] == pytest.approx(np.linspace(0, 1, 5))


def test_a_stated_unit_replaces_the_one_of_the_names(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("time_s,shoulder_pan.pos\n0,0\n1,90\n")
    ends = {}
    for unit in ("", "deg", "lerobot_deg", "rad"):
        (found,) = read_trajectories(tmp_path / "a.csv", unit=unit)
        ends[unit] = found.for_joints(RANGES)[1][-1, 0]
    assert ends[""] == pytest.approx(1.8)  # of 2 rad, by LeRobot's percent
    assert ends["deg"] == pytest.approx(np.pi / 2)
    assert ends["lerobot_deg"] == pytest.approx(np.pi / 2, rel=1e-3)
    assert ends["rad"] == 90


@pytest.mark.parametrize("name", ["LeRobotWriter", "ParquetWriter", "CsvWriter", "JsonlWriter"])
def test_our_own_data_sets_are_read_in_every_format(tmp_path: Path, name: str) -> None:
    features = FeatureSet(
        Feature(key, "float32", (2,), JOINTS, "rad") for key in ("observation.state", "action")
    )
    written = getattr(writer, name)(DatasetLayout(tmp_path / "data", "so_arm100", 10, features))
    written.open()
    for episode in range(2):
        for index, position in enumerate(POSITIONS + 0.1 * episode):
            values = {"observation.state": position - 0.5, "action": position}
            written.add_frame(Frame(10**9 + index * 10**8, {k: v.astype("f4") for k, v in values.items()}))
        written.end_episode("wave")
    written.close()
    first, second = read_trajectories(tmp_path / "data")
    assert first.time_s == pytest.approx(TIMES, abs=1e-6)
    joints, position = second.for_joints(RANGES)
    assert joints == JOINTS
    assert position == pytest.approx(POSITIONS + 0.1, abs=1e-6)  # what was commanded, in radians
    (chosen,) = read_trajectories(tmp_path / "data", (1,))
    assert chosen.position == pytest.approx(second.position)
    with pytest.raises(TrajectoryError, match=r"has no episode 2: it has 0 to 1"):
        read_trajectories(tmp_path / "data", (2,))


@pytest.mark.parametrize("name", ["LeRobotWriter", "CsvWriter", "JsonlWriter"])
def test_a_data_set_of_one_joint_is_read(tmp_path: Path, name: str) -> None:
    features = FeatureSet([Feature("action", "float32", (1,), JOINTS[:1], "rad")])
    written = getattr(writer, name)(DatasetLayout(tmp_path / "data", "motor", 10, features))
    written.open()
    for index, position in enumerate(POSITIONS[:, :1].astype("f4")):
        written.add_frame(Frame(10**9 + index * 10**8, {"action": position}))
    written.end_episode("turn")
    written.close()
    (found,) = read_trajectories(tmp_path / "data")
    assert found.names == JOINTS[:1]
    assert found.position == pytest.approx(POSITIONS[:, :1], abs=1e-6)


@pytest.mark.parametrize("version", ["v3.0", "v2.1"])
def test_a_data_set_that_lerobot_has_recorded_is_read(tmp_path: Path, version: str) -> None:
    """Both layouts as LeRobot writes them: normalised joints, videos beside them, several episodes."""
    data = tmp_path / "data" / "chunk-000"
    data.mkdir(parents=True)
    (tmp_path / "meta").mkdir()
    joints = {"dtype": "float32", "shape": [2], "names": [f"{name}.pos" for name in JOINTS]}
    video = {"dtype": "video", "shape": [480, 640, 3], "names": ["height", "width", "channels"]}
    scalar = {"dtype": "int64", "shape": [1], "names": None}
    features: dict[str, object] = {
        "action": joints,
        "observation.state": joints,
        "observation.images.top": video,
    }
    features |= dict.fromkeys(("frame_index", "episode_index", "index", "task_index"), scalar)
    features["timestamp"] = {"dtype": "float32", "shape": [1], "names": None}
    info = {"codebase_version": version, "robot_type": "so101_follower", "fps": 10, "features": features}
    (tmp_path / "meta" / "info.json").write_text(json.dumps(info))
    percent = np.column_stack([np.linspace(-100, 100, 5), np.linspace(0, 100, 5)]).astype("f4")
    episodes = [
        {
            "action": pyarrow.FixedSizeListArray.from_arrays(percent.ravel(), 2),
            "timestamp": TIMES.astype("f4"),
            "episode_index": np.full(5, number),
        }
        for number in range(2)
    ]
    if version == "v2.1":
        for number, columns in enumerate(episodes):
            pyarrow.parquet.write_table(pyarrow.table(columns), data / f"episode_{number:06d}.parquet")
    else:
        tables = [pyarrow.table(columns) for columns in episodes]
        pyarrow.parquet.write_table(pyarrow.concat_tables(tables), data / "file-000.parquet")
    found = read_trajectories(tmp_path)
    assert len(found) == 2
    _, position = found[1].for_joints(RANGES)
    assert position[:, 0] == pytest.approx(np.linspace(-2, 2, 5), abs=1e-5)
    assert position[:, 1] == pytest.approx(np.linspace(0, 1, 5), abs=1e-5)


def test_columns_that_fit_nothing_are_named() -> None:
    with pytest.raises(TrajectoryError, match=r"no column fits a joint.*griper.*rename the columns"):
        trajectory("griper", "shoulder_pam").for_joints(RANGES)
    with pytest.raises(TrajectoryError, match=r"2 columns without names, and the model has 1"):
        trajectory().for_joints({"shoulder_pan": RANGES["shoulder_pan"]})
