"""``tools/check_policies.py``, the last step of ``tools/policies.sh``, beside the real libraries."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

SCRIPT = Path(__file__).resolve().parents[2] / "tools" / "check_policies.py"


RENDER = """
import mujoco
from joshua_mujoco_sim.rendering import CameraRenderer

model = mujoco.MjModel.from_xml_string(
    "<mujoco><worldbody><camera name='top' pos='0 0 1'/><geom size='.1'/></worldbody></mujoco>"
)
data = mujoco.MjData(model)
mujoco.mj_forward(model, data)
renderer = CameraRenderer(model, "top", 64, 48)
renderer.look(data)
print(renderer.draw().shape)
import torch._dynamo
import lerobot.policies.act.modeling_act
"""


def test_a_policy_can_be_imported_after_a_picture_was_rendered() -> None:
    done = subprocess.run([sys.executable, "-c", RENDER], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[-1000:]
    assert done.stdout == "(48, 64, 3)\n"


def check(*folders: Path) -> subprocess.CompletedProcess[str]:
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(map(str, folders))}
    return subprocess.run(
        [sys.executable, str(SCRIPT)], env=environment, capture_output=True, text=True, check=False
    )


def test_an_environment_that_runs_policies_is_confirmed() -> None:
    done = check()
    assert done.returncode == 0, done.stderr
    assert done.stderr.startswith("checked: ACT computed an action with lerobot 0.4.4, torch 2.14.1")
    assert "warning" not in done.stderr


def test_a_torchvision_without_its_operators_is_named(tmp_path: Path) -> None:
    (tmp_path / "torchvision").mkdir()
    (tmp_path / "torchvision/__init__.py").write_text(
        "raise RuntimeError('operator torchvision::nms does not exist')\n"
    )
    done = check(tmp_path)
    assert done.returncode == 1
    assert "error: torchvision does not work with this torch: RuntimeError: operator" in done.stderr
    assert "next: install both in one call of pip" in done.stderr


def test_an_unusable_lerobot_is_named(tmp_path: Path) -> None:
    (tmp_path / "lerobot").mkdir()
    (tmp_path / "lerobot/__init__.py").write_text("")
    done = check(tmp_path)
    assert done.returncode == 1
    assert "error: LeRobot cannot compute an action: ModuleNotFoundError" in done.stderr
    assert "constraints-learn.txt" in done.stderr


def test_a_decoder_without_ffmpeg_is_a_warning(tmp_path: Path) -> None:
    (tmp_path / "torchcodec").mkdir()
    (tmp_path / "torchcodec/__init__.py").write_text("raise RuntimeError('Could not load libtorchcodec')\n")
    done = check(tmp_path)
    assert done.returncode == 0, done.stderr
    assert "warning: LeRobot's own scripts cannot read recordings with videos" in done.stderr
    assert "sudo apt install ffmpeg" in done.stderr
