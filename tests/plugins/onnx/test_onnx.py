"""Exported policies without PyTorch: checked before the start, run by onnxruntime, refused with a remedy."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import time
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from checkpoints import write_checkpoint, write_robot
from exported_policies import NETWORK, write_exported
from joshua.api import JointSpace, ModelError, Observation
from joshua.api.models import Compute
from joshua.testing import check_model
from joshua.testing.domain import reserved_domain
from joshua.tools import check
from joshua_onnx.model import OnnxModel
from joshua_onnx.settings import OnnxSettings

BLOCK = "plugin_config { [joshua/joshua.OnnxPolicy] {} }"
OPTIONS = ["--duration", "1", "--start-timeout", "300"]
JOINTS = JointSpace(tuple("abcdef"), np.full(6, -2.0), np.full(6, 2.0))


@pytest.fixture
def exported(tmp_path: Path) -> Path:
    return write_exported(tmp_path / "policy")


def made(folder: Path, **chosen: Any) -> OnnxModel:
    return OnnxModel(OnnxSettings(weights=str(folder), rate_hz=30.0, **chosen), JOINTS)


def seen(position_rad: float = 0.5) -> Observation:
    values: dict[str, Any] = {
        "observation.state": np.full(6, position_rad, np.float32),
        "observation.images.top": np.full((48, 64, 3), 255, np.uint8),
    }
    return Observation(time.time_ns(), values)


def findings(path: Path) -> list[tuple[str, str]]:
    return [(item.message, item.remedy) for item in check(path).errors]


def test_the_model_keeps_the_contract(exported: Path):
    check_model(lambda: made(exported), observe=seen)


def test_a_policy_in_radians_gets_and_gives_them(exported: Path):
    model = made(exported)
    model.load()
    np.testing.assert_allclose(model.act(seen()), [[0.6] * 6, [0.3] * 6], atol=1e-6)
    assert model.needs().reads_state
    model.close()


def test_a_policy_in_the_units_of_lerobot_gets_and_gives_those(tmp_path: Path):
    model = made(write_exported(tmp_path / "policy", radians=False), actions_per_chunk=1)
    model.load()
    # 0.5 rad of ±2 rad are 25 of ±100; the network adds 0.1
    np.testing.assert_allclose(model.act(seen()), [[0.502] * 6], atol=1e-6)
    model.close()


def test_a_policy_that_fits_is_valid_and_another_camera_is_named(tmp_path: Path, exported: Path):
    assert findings(write_robot(tmp_path / "robot.pbtxt", "policy", block=BLOCK)) == []
    robot = write_robot(tmp_path / "robot.pbtxt", "policy", block=BLOCK, cameras={"front": (64, 48)})
    ((message, remedy),) = findings(robot)
    assert "needs observation.images.top" in message
    assert 'rename { robot: "front" model: "top" }' in remedy


def test_a_file_that_is_not_whole_is_found_by_its_length(tmp_path: Path, exported: Path):
    (exported / "policy.onnx").write_bytes(NETWORK[:-1])
    ((message, remedy),) = findings(write_robot(tmp_path / "robot.pbtxt", "policy", block=BLOCK))
    assert f"has {len(NETWORK) - 1} bytes, but {len(NETWORK)} were exported" in message
    assert remedy == "Copy or download the policy again."


def test_a_checkpoint_that_was_not_exported_names_the_command(tmp_path: Path):
    write_checkpoint(tmp_path / "policy")
    ((message, remedy),) = findings(write_robot(tmp_path / "robot.pbtxt", "policy", block=BLOCK))
    assert message == f"{tmp_path / 'policy'} contains no exported policy."
    assert remedy == f"Export it: joshua policy export {tmp_path / 'policy'} {tmp_path / 'policy_onnx'}."
    (tmp_path / "policy" / "policy.pkl").write_bytes(b"")
    assert "policy.pkl, a pickle" in findings(tmp_path / "robot.pbtxt")[0][0]


def test_half_precision_is_refused(tmp_path: Path, exported: Path):
    robot = write_robot(
        tmp_path / "robot.pbtxt", "policy", block=BLOCK, extra='compute { precision: "bfloat16" }'
    )
    ((message, _),) = findings(robot)
    assert message == "An exported policy computes in float32, but compute says bfloat16."


def test_a_device_that_is_not_there_and_a_broken_network_say_what_to_do(tmp_path: Path, exported: Path):
    with pytest.raises(ModelError, match=r'device: "cuda" is not available; onnxruntime .* finds cpu'):
        made(exported, compute=Compute(device="cuda")).load()
    broken = write_exported(tmp_path / "broken", b"not a network")
    with pytest.raises(ModelError, match=r"cannot be loaded: .* Export the policy again"):
        made(broken).load()
    model = made(exported)
    model.load()
    picture = np.zeros((8, 8, 3), np.uint8)
    with pytest.raises(ModelError, match=r"policy\.onnx cannot be run"):
        model.act(Observation(1, {**seen().values, "observation.images.top": picture}))
    model.close()


def test_without_memory_the_message_says_so(exported: Path, monkeypatch: pytest.MonkeyPatch):
    import onnxruntime

    model = made(exported)
    model.load()
    said = "[ONNXRuntimeError] : 6 : Failed to allocate memory for requested buffer of size 8"

    def full(*_: Any, **__: Any) -> Any:
        raise RuntimeError(said)

    monkeypatch.setattr(model, "_session", SimpleNamespace(run=full))
    with pytest.raises(ModelError, match=r"policy\.onnx cannot be run: the memory is too small: .*End other"):
        model.act(seen())
    monkeypatch.setattr(onnxruntime, "InferenceSession", full)
    with pytest.raises(
        ModelError, match=r"policy\.onnx cannot be loaded: the memory is too small: .*End oth"
    ):
        model.load()


def test_checking_imports_neither_onnxruntime_nor_numpy(tmp_path: Path, exported: Path):
    robot = write_robot(tmp_path / "robot.pbtxt", "policy", block=BLOCK)
    heavy = {"onnxruntime", "numpy", "torch"}
    program = (
        f"import sys; from joshua.tools import check; assert not check({str(robot)!r}).errors; "
        f"print(sorted({heavy!r} & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_an_exported_policy_drives_mock_motors(tmp_path: Path, exported: Path):
    tmp_path.chmod(0o700)
    robot = write_robot(tmp_path / "robot.pbtxt", "policy", block=BLOCK)
    with reserved_domain() as domain:
        done = subprocess.run(
            [sys.executable, "-m", "joshua", "--config", str(robot), *OPTIONS],
            capture_output=True,
            text=True,
            env={**os.environ, "ROS_DOMAIN_ID": str(domain), "XDG_RUNTIME_DIR": str(tmp_path)},
            timeout=120,
            check=False,
        )
    assert done.returncode == 0, done.stdout + done.stderr
    row = re.search(r"in /ai/actions.* (\d+)$", done.stdout, re.MULTILINE)
    assert row is not None, done.stdout
    assert int(row[1]) > 0


def test_export_without_pytorch_names_what_to_install(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys
):
    from joshua.cli.main import main

    write_checkpoint(tmp_path / "act", kind="diffusion")
    assert main(["policy", "export", str(tmp_path / "act"), str(tmp_path / "onnx")]) == 1
    assert "holds a policy of type 'diffusion'; only act and mlp can" in capsys.readouterr().err
    write_checkpoint(tmp_path / "act")
    monkeypatch.setitem(sys.modules, "torch", None)
    assert main(["policy", "export", str(tmp_path / "act"), str(tmp_path / "onnx")]) == 3
    said = capsys.readouterr().err
    assert "requires torch, which is not installed for" in said
    assert "tools/policies.sh policies (PyTorch and LeRobot, 1 to 9 GB)" in said
    assert 'python: "policies/bin/python"' in said
    assert json.loads((tmp_path / "act" / "config.json").read_text())["type"] == "act"
