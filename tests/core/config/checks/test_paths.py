"""Files that a run reads: where they are looked for, and when a missing one is an error."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from joshua.config import load
from joshua.config.checks.paths import check_paths
from joshua.plan import Diagnostic, Severity

MOTION = """general {{ mode: MODE_TEST }}
robot {{
  actions {{
    node {{ node_name: "arm" node_id: 1 {node} }}
    action_type: ACTION_MOCK
    mock_motor_config {{ num_motors: 1 position_max: 10 motion: MOCK_MOTION_FILE motion_file: "{file}" }}
  }}
}}
"""
EVAL = """general {{ mode: MODE_TRAINING }}
ai {{ training {{ method: METHOD_EVAL eval_config {{ model_checkpoint: "{weights}" num_episodes: 1 }} }} }}
"""


def examine(path: Path, text: str, **options: object) -> list[Diagnostic]:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8")
    return check_paths(load(str(path)), **{"launch": True, **options})  # type: ignore[arg-type]


def test_a_missing_file_is_a_note_unless_nodes_start(tmp_path: Path) -> None:
    path = tmp_path / "robot.pbtxt"
    (found,) = examine(path, MOTION.format(node="", file="wave.csv"), launch=False)
    assert (found.code, found.severity) == ("input-file-missing", Severity.NOTE)
    (found,) = examine(path, MOTION.format(node="", file="wave.csv"))
    assert found.severity is Severity.ERROR
    assert str(tmp_path / "wave.csv") in found.message


def test_a_relative_path_starts_at_the_file_that_names_it(tmp_path: Path) -> None:
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts" / "wave.csv").touch()
    (tmp_path / "parts" / "arm.pbtxt").write_text(MOTION.format(node="", file="wave.csv"), encoding="utf-8")
    assert examine(tmp_path / "robot.pbtxt", 'include: "parts/arm.pbtxt"') == []


def test_an_override_starts_at_the_root_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "robot.pbtxt"
    path.write_text(MOTION.format(node="", file="none.csv"), encoding="utf-8")
    (tmp_path / "wave.csv").touch()
    monkeypatch.chdir("/")
    field = "robot.actions[0].mock_motor_config.motion_file"
    loaded = load(str(path), overrides=[f'{field}="wave.csv"'])
    assert loaded.diagnostics == []
    assert check_paths(loaded, launch=True) == []


def test_absolute_paths_and_the_home_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "wave.csv").touch()
    monkeypatch.setenv("HOME", str(tmp_path))
    path = tmp_path / "elsewhere" / "robot.pbtxt"
    assert examine(path, MOTION.format(node="", file="~/wave.csv")) == []
    assert examine(path, MOTION.format(node="", file=tmp_path / "wave.csv")) == []
    (found,) = examine(path, MOTION.format(node="", file="~nobody-of-this-name/wave.csv"))
    assert found.code == "input-file-missing"


def test_a_folder_is_no_file(tmp_path: Path) -> None:
    (found,) = examine(tmp_path / "robot.pbtxt", MOTION.format(node="", file="."))
    assert found.code == "input-file-is-folder"


def test_a_file_that_may_not_be_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "wave.csv").touch()
    # Root may read everything, so the answer of the operating system is given here.
    monkeypatch.setattr(os, "access", lambda path, mode: False)
    (found,) = examine(tmp_path / "robot.pbtxt", MOTION.format(node="", file="wave.csv"))
    assert found.code == "input-file-unreadable"
    assert "permissions" in found.remedy


def test_a_git_lfs_pointer_is_named_with_the_command_that_fetches_the_file(tmp_path: Path) -> None:
    (tmp_path / ".git").mkdir()
    (tmp_path / "wave.csv").write_text("version https://git-lfs.github.com/spec/v1\noid sha256:0\nsize 9\n")
    (found,) = examine(tmp_path / "robot.pbtxt", MOTION.format(node="", file="wave.csv"))
    assert (found.code, found.severity) == ("input-file-is-pointer", Severity.ERROR)
    assert "is a Git LFS pointer" in found.message
    assert found.remedy == f"Run git -C {tmp_path} lfs pull --include wave.csv."


def test_a_name_that_the_system_refuses_does_not_exist(tmp_path: Path) -> None:
    (found,) = examine(tmp_path / "robot.pbtxt", MOTION.format(node="", file="a" * 3000))
    assert found.code == "input-file-missing"


def test_files_of_other_machines_are_not_looked_for(tmp_path: Path) -> None:
    path = tmp_path / "robot.pbtxt"
    text = MOTION.format(node='host: "jetson"', file="wave.csv")
    assert examine(path, text, host="desktop") == []
    assert len(examine(path, text, host="jetson")) == 1
    assert len(examine(path, text)) == 1


def test_missing_weights_are_an_error_without_a_launch(tmp_path: Path) -> None:
    path = tmp_path / "robot.pbtxt"
    (found,) = examine(path, EVAL.format(weights="runs/a"), launch=False)
    assert (found.code, found.severity) == ("weights-not-found", Severity.ERROR)
    shipped = {"runs/a": tmp_path}
    assert examine(path, EVAL.format(weights="runs/a"), packaged_weights=shipped.get) == []


def test_weights_of_a_method_that_does_not_run_are_not_looked_for(tmp_path: Path) -> None:
    text = EVAL.format(weights="runs/a").replace("METHOD_EVAL", "METHOD_RL")
    assert examine(tmp_path / "robot.pbtxt", text) == []


@pytest.mark.parametrize("weights", ["lerobot/smolvla_base", "my-name/policy.v2"])
def test_a_hub_id_is_no_path(weights: str, tmp_path: Path) -> None:
    assert examine(tmp_path / "robot.pbtxt", EVAL.format(weights=weights)) == []


@pytest.mark.parametrize(
    "weights",
    ["./policy", "checkpoints/policy", "runs/a", "policy.pt", "owner/policy.safetensors", "/a/b", "a/b/c"],
)
def test_a_path_is_no_hub_id(weights: str, tmp_path: Path) -> None:
    (found,) = examine(tmp_path / "robot.pbtxt", EVAL.format(weights=weights))
    assert found.code == "weights-not-found"


def test_a_name_under_a_folder_that_exists_is_a_path(tmp_path: Path) -> None:
    (tmp_path / "mine").mkdir()
    (found,) = examine(tmp_path / "robot.pbtxt", EVAL.format(weights="mine/policy"))
    assert found.code == "weights-not-found"
    (tmp_path / "mine" / "policy").touch()
    assert examine(tmp_path / "robot.pbtxt", EVAL.format(weights="mine/policy")) == []


def test_a_packaged_model_needs_no_file(tmp_path: Path) -> None:
    text = (
        'general { mode: MODE_SIMULATION } simulation { mode: OFFSCREEN model_path: "so_arm100/scene.xml" }'
    )
    path = tmp_path / "robot.pbtxt"
    assert examine(path, text, is_packaged=lambda name: name == "so_arm100/scene.xml") == []
    (unknown,) = examine(path, text, is_packaged=lambda name: False, launch=True)
    assert (unknown.code, unknown.severity) == ("input-file-missing", Severity.ERROR)
    assert "no installed simulator brings a model of this name" in unknown.message


def test_whether_a_model_is_packaged_is_left_open_where_no_simulator_is_installed(tmp_path: Path) -> None:
    text = 'general { mode: MODE_SIMULATION } simulation { mode: OFFSCREEN model_path: "lab/scene.xml" }'
    path = tmp_path / "robot.pbtxt"
    for launch in (False, True):
        (item,) = examine(path, text, launch=launch)
        assert (item.code, item.severity) == ("input-file-missing", Severity.NOTE)
        assert (
            "The simulator's plugin may bring a model of this name, but it is not installed" in item.message
        )
    (tmp_path / "lab").mkdir()
    (tmp_path / "lab/scene.xml").touch()
    assert examine(path, text, launch=True) == []


def test_the_model_of_a_simulation_beside_devices_is_left_to_the_simulator(tmp_path: Path) -> None:
    text = 'general { mode: MODE_TELEOPERATE } simulation { mode: OFFSCREEN model_path: "x.xml" }'
    assert examine(tmp_path / "robot.pbtxt", text) == []


def test_an_interpreter_must_be_executable(tmp_path: Path) -> None:
    text = MOTION.format(node='python: "bin/python"', file="wave.csv")
    (tmp_path / "wave.csv").touch()
    (tmp_path / "bin").mkdir()
    interpreter = tmp_path / "bin" / "python"
    interpreter.touch()
    interpreter.chmod(0o644)
    assert [item.code for item in examine(tmp_path / "robot.pbtxt", text)] == ["interpreter-missing"]
    interpreter.chmod(0o755)
    assert examine(tmp_path / "robot.pbtxt", text) == []


@pytest.mark.parametrize(
    ("store", "name", "codes"),
    [
        ("", "lerobot/pusht", []),
        ("", "demos", ["dataset-missing"]),
        ('local_path: "sets/demos"', "demos", ["dataset-missing"]),
        ('local_path: "there"', "demos", []),
    ],
)
def test_the_data_set_of_imitation_learning(store: str, name: str, codes: list[str], tmp_path: Path) -> None:
    (tmp_path / "there").mkdir()
    block = f'data_store {{ dataset_name: "{name}" {store} }}' if store else ""
    text = (
        f"general {{ mode: MODE_TRAINING }} ai {{ {block} training {{ method: METHOD_IMITATION "
        f'imitation_config {{ dataset_name: "{name}" }} }} }}'
    )
    assert [item.code for item in examine(tmp_path / "robot.pbtxt", text)] == codes


def test_a_private_key_that_others_can_read_is_a_warning(tmp_path: Path) -> None:
    for name in ("ca.pem", "robot.pem", "robot.key"):
        (tmp_path / name).write_text("")
        (tmp_path / name).chmod(0o644)
    text = """transport {
      kind: TRANSPORT_ZENOH listen_endpoints: "tls/0.0.0.0:7447"
      tls { root_ca_file: "ca.pem" certificate_file: "robot.pem" private_key_file: "robot.key" }
    }"""
    (found,) = examine(tmp_path / "robot.pbtxt", text)
    assert (found.code, found.severity) == ("private-key-readable", Severity.WARNING)
    assert found.message == (
        "Every user of this machine can read the private key and command the robot with it: "
        f"{tmp_path / 'robot.key'} has mode 0644."
    )
    assert found.remedy == f"Run chmod 600 {tmp_path / 'robot.key'}."
    for mode in (0o600, 0o640):
        (tmp_path / "robot.key").chmod(mode)
        assert examine(tmp_path / "robot.pbtxt", text) == []
