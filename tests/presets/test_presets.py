"""The presets as a set: the names of the specification's table and our own, honest headers, what ships."""

from __future__ import annotations

import argparse
import importlib
import re
import subprocess
import sys
import tarfile
import zipfile
from pathlib import Path

import pytest
from google.protobuf import text_format
from joshua.cli.commands import fmt
from joshua.cli.commands.new import copy_of
from joshua.cli.presets import FOLDER, Preset, preset_names, read_preset, read_presets
from joshua.config import check, load
from joshua.config.checks.paths import check_paths
from joshua.modes import check_mode
from joshua.plan import Severity
from joshua.planner.pipeline import examine
from joshua.planner.request import Purpose, Request
from joshua.plugins import load_registry
from joshua.plugins.hints import distribution_for, stated
from joshua.schema import config_pb2 as pb
from joshua.schema import simulation_pb2 as sim

ROOT = Path(__file__).resolve().parents[2]

TABLE = {
    "TELEOPERATE": [
        "teleop_so_arm100",
        "teleop_so_arm100_camera",
        "teleop_xbox_controller",
        "teleop_keyboard",
        "teleop_dual_arm",
        "ros_follower",
    ],
    "INFERENCE": [
        "inference_smolvla",
        "inference_smolvla_jetson",
        "inference_ppo_policy",
        "inference_random_noise",
    ],
    "TRAINING": [
        "training_rl_ppo",
        "training_rl_mjx",
        "training_rl_isaac",
        "training_imitation",
        "training_eval",
    ],
    "CALIBRATION": ["calibrate_so_arm100", "calibrate_spike"],
    "TEST": ["test_single_motor", "test_camera", "test_mock_hardware", "test_lidar", "test_spike_ble"],
    "DATA_STORE": [
        "data_store_record",
        "data_store_demonstrations",
        "data_store_upload",
        "data_store_replay",
    ],
    "SIMULATION": ["sim_interactive", "sim_passive", "sim_mirror", "sim_offscreen", "sim_lekoch"],
}

PRESETS = read_presets()
each_preset = pytest.mark.parametrize("preset", PRESETS, ids=lambda preset: preset.name)


def parse(preset: Preset) -> pb.Config:
    importlib.import_module("joshua_ppo_trainer.ppo_pb2")  # registers the message of a preset
    return text_format.Parse(preset.text, pb.Config())


def test_the_table_is_complete():
    assert preset_names() == sorted(name for names in TABLE.values() for name in names)


@each_preset
def test_each_has_the_mode_of_its_row_and_its_own_name(preset: Preset):
    general = parse(preset).general
    assert pb.OperationMode.Name(general.mode) == f"MODE_{preset.mode}"
    assert preset.name in TABLE[preset.mode]
    assert general.name == preset.name
    assert general.id
    assert general.robot_type


@each_preset
def test_each_header_says_what_a_user_needs_to_know(preset: Preset):
    assert list(preset.sections) == ["Needs", "Plugins", "Run", "Change"]
    assert preset.summary.endswith((".", "?"))
    assert preset.sections["Run"][0].startswith(f"joshua --config {preset.name}.pbtxt")


@each_preset
def test_each_header_names_the_plugins_of_its_blocks(preset: Preset):
    named = set(re.findall(r"joshua-[a-z0-9-]+", preset.plugins))
    assert named <= stated().distributions()
    assert needed_plugins(parse(preset)) - named == set()


def needed_plugins(config: pb.Config) -> set[str]:
    """Distributions that the blocks of a file ask for, by the table of known plugins."""
    found = {
        distribution_for(owner.WhichOneof(oneof))
        for group, oneof in (
            (config.robot.actions, "actuator_config"),
            (config.robot.perceptions, "device_config"),
        )
        for owner in group
    }
    found |= {distribution_for("", pb.ModelType.Name(model.model_type)) for model in config.ai.models}
    if config.ai.HasField("data_store"):
        found.add(distribution_for("data_store"))
    if config.HasField("simulation"):
        found.add(distribution_for("", sim.SimulationMode.Name(config.simulation.mode)))
    training = config.ai.training
    if training.method == pb.METHOD_RL:
        found.add(distribution_for("", pb.SimulatorBackend.Name(training.simulator_backend)))
    elif training.method:
        found.add(distribution_for("", pb.TrainingMethod.Name(training.method)))
    return found - {"joshua-core", ""}


def test_the_rows_hold_what_the_table_promises():
    presets = {preset.name: parse(preset) for preset in PRESETS}

    def pictures(name: str) -> int:
        return len([p for p in presets[name].robot.perceptions if p.perception_type == pb.PERCEPTION_CAMERA])

    assert pictures("teleop_so_arm100_camera") == pictures("inference_smolvla") == 2
    assert len(presets["teleop_dual_arm"].robot.actions) == 4
    rl = presets["training_rl_mjx"].ai.training
    assert (rl.rl_config.algorithm, rl.rl_config.num_envs, rl.simulator_backend) == (
        "PPO",
        2048,
        pb.BACKEND_MJX,
    )
    # an iteration is 32 steps of each environment: a checkpoint after every 16th, not every second
    assert rl.rl_config.checkpoint_steps >= 10 * 32 * rl.rl_config.num_envs
    assert presets["training_rl_isaac"].ai.training.simulator_backend == pb.BACKEND_ISAAC
    assert list(presets["training_eval"].ai.training.eval_config.metrics) == ["success_rate", "avg_return"]
    assert presets["calibrate_so_arm100"].calibration_run.display
    assert presets["test_camera"].robot.perceptions[0].camera_config.display
    assert presets["test_lidar"].robot.perceptions[0].lidar_config.display
    operations = [presets[f"data_store_{name}"].ai.data_store.operation for name in ("record", "upload")]
    assert operations == [pb.DATA_STORE_RECORD, pb.DATA_STORE_UPLOAD]
    assert presets["data_store_replay"].ai.data_store.operation == pb.DATA_STORE_REPLAY
    modes = {name: presets[f"sim_{name}"].simulation.mode for name in ("interactive", "passive", "mirror")}
    assert modes == {"interactive": sim.INTERACTIVE, "passive": sim.PASSIVE, "mirror": sim.MIRROR}
    assert presets["sim_offscreen"].simulation.mode == sim.OFFSCREEN
    assert presets["sim_lekoch"].general.robot_type == "LeKoch"
    mock = presets["test_mock_hardware"]
    assert len(mock.robot.actions) + len(mock.robot.perceptions) == 3
    assert mock.test.duration_s == 5
    for config in presets.values():
        for perception in config.robot.perceptions:
            if perception.perception_type == pb.PERCEPTION_CAMERA:
                assert perception.node.qos.reliability == pb.BEST_EFFORT
                assert perception.node.qos.depth == 1
        for action in config.robot.actions:
            assert action.sts3215_config.comm.serial.baudrate in (0, 1_000_000)


def test_servos_of_one_robot_are_calibrated_under_the_names_that_use_them():
    calibrated = parse(read_preset("calibrate_so_arm100"))
    names = {action.node.node_name for action in calibrated.robot.actions}
    for preset in PRESETS:
        config = parse(preset)
        if config.general.id == calibrated.general.id:
            assert {action.node.node_name for action in config.robot.actions} <= names


def test_the_presets_are_the_files_of_configs():
    assert FOLDER.resolve() == ROOT / "configs"


def test_the_layout_is_that_of_joshua_fmt(capsys: pytest.CaptureFixture[str]):
    parser = argparse.ArgumentParser()
    fmt.add_arguments(parser)
    files = [str(FOLDER / f"{name}.pbtxt") for name in preset_names()]
    assert fmt.run(parser.parse_args(["--check", *files])) == 0, capsys.readouterr()


@pytest.mark.slow
@pytest.mark.timeout(300)
def test_wheel_and_source_archive_contain_presets_templates_and_stubs(tmp_path: Path):
    pytest.importorskip("hatchling")
    build = "import hatchling.build as b, sys; b.build_sdist(sys.argv[1]); b.build_wheel(sys.argv[1])"
    subprocess.run([sys.executable, "-c", build, tmp_path], cwd=ROOT / "joshua-core", check=True, timeout=200)
    (wheel,) = tmp_path.glob("*.whl")
    (archive,) = tmp_path.glob("*.tar.gz")
    in_wheel = set(zipfile.ZipFile(wheel).namelist())
    with tarfile.open(archive) as tar:
        in_archive = {member.name.partition("/")[2]: member for member in tar.getmembers()}
    for name in preset_names():
        assert f"joshua/presets/{name}.pbtxt" in in_wheel
        assert in_archive[f"src/joshua/presets/{name}.pbtxt"].isreg()
    package = ROOT / "joshua-core" / "src"
    data = [path for suffix in ("template", "pyi", "json", "typed") for path in package.rglob(f"*.{suffix}")]
    assert {"new_plugin.template", "config_pb2.pyi", "codes.json", "py.typed"} <= {path.name for path in data}
    for path in data:
        name = path.relative_to(package).as_posix()
        assert name in in_wheel
        assert f"src/{name}" in in_archive


@each_preset
def test_each_is_valid_and_only_what_comes_from_elsewhere_is_noted(
    preset: Preset, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.chdir(FOLDER)
    registry = load_registry()
    loaded = load(f"{preset.name}.pbtxt", message_types=registry.message_modules())
    files = check_paths(loaded, launch=False, packaged_weights=registry.packaged_weights)
    found = [*loaded.diagnostics, *check(loaded), *check_mode(loaded), *files]
    assert {(item.code, item.severity) for item in found} <= {
        ("input-file-missing", Severity.NOTE),
        ("dataset-missing", Severity.NOTE),
        ("mapping-unpublished", Severity.NOTE),
    }
    assert len(found) <= 2, "a note is worth reading once"


@each_preset
def test_each_copy_is_valid_and_lacks_no_plugin_that_its_header_hides(
    preset: Preset, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.chdir(tmp_path)
    Path("mine.pbtxt").write_text(copy_of(preset, "mine", "mine"), encoding="utf-8")
    examination = examine(Request("mine.pbtxt", purpose=Purpose.VALIDATE))
    assert {item.severity for item in examination.diagnostics} <= {Severity.NOTE}
    missing = {
        name
        for item in examination.diagnostics
        if item.code == "plugin-missing"
        for name in re.findall(r"requires the plugin (joshua-[\w-]+)", item.message)
    }
    assert missing <= set(re.findall(r"joshua-[a-z0-9-]+", preset.plugins))
