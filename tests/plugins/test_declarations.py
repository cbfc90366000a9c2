"""What each plugin declares is good, and neither listing nor checking imports what drives its devices."""

from __future__ import annotations

import subprocess
import sys
from typing import Any

import pytest
from joshua.plugins import ActuatorSpec, ModelSpec, PluginStatus, SensorSpec, load_registry
from joshua.plugins.targets import check_targets

DECLARED = [
    ("sts3215", ActuatorSpec, "sts3215_config", "ACTION_LEADER"),
    ("dynamixel", ActuatorSpec, "dynamixel_config", "ACTION_FOLLOWER"),
    ("spike", ActuatorSpec, "spike_motor_config", "ACTION_SPIKE"),
    ("camera", SensorSpec, "camera_config", "PERCEPTION_CAMERA"),
    ("encoder", SensorSpec, "encoder_config", "PERCEPTION_ENCODER"),
    ("lidar", SensorSpec, "lidar_config", "PERCEPTION_LIDAR"),
    ("teleop-input", SensorSpec, "gamepad_config", "PERCEPTION_GAMEPAD"),
    ("teleop-input", SensorSpec, "keyboard_config", "PERCEPTION_KEYBOARD"),
    ("lerobot", ModelSpec, "joshua.LeRobotPolicy", "MODEL_PLUGIN"),
    ("smolvla", ModelSpec, "smolvla_config", "SMOLVLA"),
    ("onnx", ModelSpec, "joshua.OnnxPolicy", "MODEL_PLUGIN"),
]
DRIVERS = {
    *(
        "numpy",
        "cv2",
        "ruamel",
        "zenoh",
        "serial",
        "scservo_sdk",
        "dynamixel_sdk",
        "bleak",
        "bumble",
        "pygame",
    ),
    *("torch", "lerobot", "transformers", "huggingface_hub", "onnxruntime"),
    *("termios", "joshua_sts3215.actuator", "joshua_dynamixel.actuator", "joshua_spike.actuator"),
}


@pytest.mark.parametrize(("name", "kind", "block", "value"), DECLARED, ids=[row[2] for row in DECLARED])
def test_the_spec_is_good(name: str, kind: Any, block: str, value: str) -> None:
    registry = load_registry()
    (row,) = (row for row in registry.rows() if row.distribution == f"joshua-{name}")
    assert row.status is PluginStatus.OK, row.reasons
    spec = registry.find(kind, block, value)
    assert spec is not None
    assert check_targets(spec) == []
    assert getattr(spec, "terminal", False) is (block == "keyboard_config")


@pytest.mark.parametrize("name", sorted({name for name, *_ in DECLARED}))
def test_listing_and_settings_import_nothing_heavy(name: str) -> None:
    program = (
        "import sys; from joshua.plugins import load_registry; load_registry(); "
        f"import joshua_{name.replace('-', '_')}.settings; "
        f"print(sorted({DRIVERS!r} & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
