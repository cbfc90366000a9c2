"""Writes checkpoints of policies as LeRobot lays them out, without LeRobot and without torch."""

from __future__ import annotations

import json
import struct
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

NAMES = ("shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_flex", "wrist_roll", "gripper")


def write_tensors(path: Path, values: Mapping[str, Sequence[float]]) -> None:
    """A safetensors file of 32-bit numbers."""
    header: dict[str, Any] = {"__metadata__": {"format": "pt"}}
    content = b""
    for name, numbers in values.items():
        begin = len(content)
        content += struct.pack(f"<{len(numbers)}f", *numbers)
        header[name] = {"dtype": "F32", "shape": [len(numbers)], "data_offsets": [begin, len(content)]}
    text = json.dumps(header).encode()
    path.write_bytes(len(text).to_bytes(8, "little") + text + content)


def write_checkpoint(
    folder: Path,
    *,
    kind: str = "act",
    cameras: Mapping[str, tuple[int, int]] | None = None,
    joints: int = 6,
    least: float = -90.0,
    greatest: float = 95.0,
    **config: Any,
) -> Path:
    """A checkpoint whose policy sees the state and some cameras, by width and height."""
    folder.mkdir(parents=True, exist_ok=True)
    seen: dict[str, Any] = {"observation.state": {"type": "STATE", "shape": [joints]}}
    for name, (width, height) in ({"top": (64, 48)} if cameras is None else cameras).items():
        seen[f"observation.images.{name}"] = {"type": "VISUAL", "shape": [3, height, width]}
    done = {"action": {"type": "ACTION", "shape": [joints]}}
    content = {
        "type": kind,
        "input_features": seen,
        "output_features": done,
        "chunk_size": 20,
        "n_action_steps": 20,
    }
    (folder / "config.json").write_text(json.dumps(content | config))
    write_tensors(folder / "model.safetensors", {"weight": [0.0, 1.0]})
    norms = {"STATE": "MEAN_STD", "ACTION": "MEAN_STD", "VISUAL": "IDENTITY"}
    for name, step, features in (
        ("policy_preprocessor", "normalizer_processor", {**seen, **done}),
        ("policy_postprocessor", "unnormalizer_processor", done),
    ):
        state = f"{name}_step_0_{step}.safetensors"
        step_of = {
            "registry_name": step,
            "config": {"features": features, "norm_map": norms},
            "state_file": state,
        }
        (folder / f"{name}.json").write_text(json.dumps({"name": name, "steps": [step_of]}))
        values: dict[str, list[float]] = {}
        for key in ("observation.state", "action"):
            middle, half = (least + greatest) / 2, (greatest - least) / 2
            numbers = {"min": least, "max": greatest, "mean": middle, "std": half / 2}
            values |= {f"{key}.{statistic}": [number] * joints for statistic, number in numbers.items()}
        write_tensors(folder / state, values)
    return folder


def write_dataset(
    folder: Path, *, names: Sequence[str] = NAMES, unit: str = "lerobot", fps: float = 30
) -> None:
    """``dataset.json`` beside a checkpoint."""
    ending = ".pos" if unit == "lerobot" else ""
    joints = {
        "dtype": "float32",
        "shape": [len(names)],
        "names": [f"{name}{ending}" for name in names],
        "unit": unit,
    }
    content = {"fps": fps, "features": {"observation.state": joints, "action": joints}}
    (folder / "dataset.json").write_text(json.dumps(content))


def write_robot(
    path: Path,
    weights: str,
    *,
    model_type: str = "MODEL_PLUGIN",
    block: str = "plugin_config { [joshua/joshua.LeRobotPolicy] {} }",
    cameras: Mapping[str, tuple[int, int]] | None = None,
    motors: int = 6,
    rate_hz: float = 30.0,
    extra: str = "",
) -> Path:
    """A file with an arm of mock motors, mock cameras and one model that commands the arm."""
    cameras = {"top": (64, 48)} if cameras is None else cameras
    shown = "".join(
        f"""
  perceptions {{
    node {{
      node_name: "camera_{name}" node_id: {10 + number}
      publishers {{ data_type: IMAGE topic_name: "/camera/{name}/image_raw" publish_rate_hz: 15.0 }}
    }}
    perception_type: PERCEPTION_CAMERA
    mock_camera_config {{ width: {width} height: {height} fps: 15 }}
  }}"""
        for number, (name, (width, height)) in enumerate(cameras.items())
    )
    seen = "".join(
        f'\n      subscriptions {{ data_type: IMAGE topic_name: "/camera/{name}/image_raw" }}'
        for name in cameras
    )
    path.write_text(
        f"""general {{ mode: MODE_INFERENCE robot_type: "SO-ARM100" name: "policy" id: "policy" }}
robot {{
  actions {{
    node {{
      node_name: "arm" node_id: 1
      publishers {{ data_type: JOINT_STATE topic_name: "/arm/joint_states" publish_rate_hz: 50.0 }}
      subscriptions {{ data_type: JOINT_STATE topic_name: "/ai/actions" }}
    }}
    action_type: ACTION_SINGLE
    mock_motor_config {{ num_motors: {motors} position_max: 4095 }}
  }}{shown}
}}
ai {{
  models {{
    model_type: {model_type}
    pretrained_model_name_or_path: "{weights}"
    {block}
    {extra}
    node {{
      node_name: "policy" node_id: 2
      publishers {{ data_type: JOINT_STATE topic_name: "/ai/actions" publish_rate_hz: {rate_hz} }}{seen}
    }}
  }}
}}
"""
    )
    return path
