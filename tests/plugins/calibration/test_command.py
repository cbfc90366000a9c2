"""``joshua calibrate``: what needs no arm, which is its command line and the exchange with LeRobot."""

from __future__ import annotations

import json
import pwd
from pathlib import Path
from typing import NoReturn

import pytest
from calibration_run import robot
from joshua.cli.main import main
from joshua_calibration.arm_file import ArmFile
from joshua_calibration.lerobot import from_lerobot

JOINTS = ("shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_flex", "wrist_roll", "gripper")


@pytest.fixture
def lerobot(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("HF_LEROBOT_HOME", str(tmp_path / "lerobot"))
    path = tmp_path / "lerobot" / "calibration" / "teleoperators" / "so100_leader" / "mine.json"
    path.parent.mkdir(parents=True)
    path.write_text(
        json.dumps(
            {
                name: {"id": i, "drive_mode": 0, "homing_offset": 10 * i, "range_min": 700, "range_max": 3000}
                for i, name in enumerate(JOINTS, 1)
            }
        )
    )
    return path


@pytest.fixture
def config(tmp_path: Path) -> str:
    return str(robot(tmp_path, "/dev/ttyACM0", mode="MODE_TEST"))


def test_it_needs_a_file(capsys: pytest.CaptureFixture[str]):
    assert main(["calibrate"]) == 2
    assert "no file given: joshua calibrate FILE" in capsys.readouterr().err


def test_the_file_is_an_argument_or_an_option(config: str, capsys: pytest.CaptureFixture[str]):
    for words in (
        ("nowhere.pbtxt",),
        ("--config", "nowhere.pbtxt"),
        ("nowhere.pbtxt", "--config", "nowhere.pbtxt"),
    ):
        assert main(["calibrate", "--check", *words]) == 2
        assert "There is no file nowhere.pbtxt" in capsys.readouterr().err
    assert main(["calibrate", "import-lerobot", "nowhere.pbtxt", "leader_arm=a.json"]) == 2
    assert "There is no file nowhere.pbtxt" in capsys.readouterr().err
    assert main(["calibrate", "a.pbtxt", "--config", "b.pbtxt"]) == 2
    assert capsys.readouterr().err == "joshua calibrate: one file is expected, found a.pbtxt, b.pbtxt\n"


def test_a_misspelt_option_is_that_of_the_command(capsys: pytest.CaptureFixture[str]):
    with pytest.raises(SystemExit, match="2"):
        main(["calibrate", "--chek"])
    assert capsys.readouterr().err.splitlines() == [
        "joshua calibrate: error: unrecognized arguments: --chek",
        "  nearest: --check",
        "  see: joshua calibrate --help",
    ]


@pytest.mark.parametrize(
    ("words", "problem"),
    [
        (("--fault", "arm:drop=1"), "joshua calibrate: --fault affects emulated devices only"),
        (("--check", "--open"), "joshua calibrate --check: --open has no effect here"),
        (("export-lerobot", "--sim"), "joshua calibrate export-lerobot: --sim has no"),
        (("import-lerobot", "--force"), "joshua calibrate import-lerobot: --force has no"),
    ],
)
def test_an_option_that_would_do_nothing_is_refused(
    words: tuple[str, ...], problem: str, config: str, capsys: pytest.CaptureFixture[str]
):
    assert main(["calibrate", *words, "--config", config]) == 2
    assert capsys.readouterr().err.startswith(problem)


def test_an_option_before_the_command_does_not_open_the_real_arm(
    config: str, capsys: pytest.CaptureFixture[str]
):
    with pytest.raises(SystemExit, match="2"):
        main(["--emulate", "calibrate", "--config", config])
    assert "calibrate is a command of a plugin and must be the first argument" in capsys.readouterr().err


def test_without_the_plugin_the_command_names_it(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr("joshua.cli.table.plugin_commands", list)
    monkeypatch.setattr("joshua.plan.installing.clone", lambda: None)
    monkeypatch.setattr("joshua.plan.installing.origin", lambda *_: "")
    with pytest.raises(SystemExit, match="3"):
        main(["calibrate"])
    assert (
        "joshua-calibration, which is not installed: pip install joshua-calibration"
        in capsys.readouterr().err
    )


def test_without_the_plugin_the_mode_names_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    file = str(robot(tmp_path, "/dev/ttyACM0"))
    assert main(["--block-plugin", "joshua-calibration", "--config", file]) == 3
    said = capsys.readouterr().err
    assert "MODE_CALIBRATION" in said
    assert "joshua-calibration" in said
    assert "nothing was started" in said


def test_lerobot_keeps_nothing_for_a_user_without_a_home(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    def unknown(uid: int) -> NoReturn:
        raise KeyError(f"getpwuid(): uid not found: {uid}")

    for name in ("HOME", "HF_HOME", "HF_LEROBOT_HOME", "HF_LEROBOT_CALIBRATION"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(pwd, "getpwuid", unknown)
    assert main(["calibrate", "import-lerobot"]) == 2
    assert "no calibration of LeRobot below ~/.cache/huggingface/lerobot" in capsys.readouterr().err


def test_an_imported_calibration_is_exported_again(
    config: str, lerobot: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    assert main(["calibrate", "import-lerobot", f"leader_arm={lerobot}", "--config", config]) == 0
    said = capsys.readouterr().out
    assert "leader_arm: 6 joints written to" in said
    assert "The servos are unchanged. Run joshua calibrate --check" in said
    assert ArmFile(tmp_path / "calibration" / "rig.pbtxt").arm("leader_arm") == from_lerobot(
        lerobot.read_text()
    )
    assert main(["calibrate", "export-lerobot", "--config", config]) == 0
    assert json.loads(capsys.readouterr().out) == json.loads(lerobot.read_text())
    out = tmp_path / "new" / "mine.json"
    assert main(["calibrate", "export-lerobot", f"leader_arm={out}", "--config", config]) == 0
    assert json.loads(out.read_text()) == json.loads(lerobot.read_text())


def test_the_offsets_of_dynamixel_servos_have_the_other_sign(config: str, lerobot: Path, tmp_path: Path):
    text = Path(config).read_text()
    block = 'dynamixel_config {\n      models: "xl330-m077"'
    Path(config).write_text(text.replace("sts3215_config {", block))
    assert main(["calibrate", "import-lerobot", str(lerobot), "--config", config]) == 0
    arm = ArmFile(tmp_path / "calibration" / "rig.pbtxt").arm("leader_arm")
    assert arm is not None
    assert [motor.homing_offset for motor in arm.motors] == [-10, -20, -30, -40, -50, -60]
    out = tmp_path / "mine.json"
    assert main(["calibrate", "export-lerobot", f"leader_arm={out}", "--config", config]) == 0
    assert json.loads(out.read_text()) == json.loads(lerobot.read_text())


def test_one_arm_needs_no_name(config: str, lerobot: Path, tmp_path: Path):
    assert main(["calibrate", "import-lerobot", str(lerobot), "--config", config]) == 0
    assert ArmFile(tmp_path / "calibration" / "rig.pbtxt").arm("leader_arm") is not None


def test_without_a_name_what_there_is_is_listed(
    lerobot: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
):
    (lerobot.parent / "broken.json").write_text("{}")
    assert main(["calibrate", "import-lerobot"]) == 2
    said = capsys.readouterr()
    assert f"{lerobot}\n  6 joints: shoulder_pan, shoulder_lift" in said.out
    assert "is an object from joint name" in said.out
    assert "name one for each arm" in said.err
    monkeypatch.setenv("HF_LEROBOT_HOME", "/nowhere")
    assert main(["calibrate", "import-lerobot"]) == 2
    assert "no calibration of LeRobot below /nowhere/calibration" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("item", "said"),
    [
        (
            "leader=PATH",
            "'leader=PATH': expected NODE=PATH with an actuator of the file; allowed: leader_arm",
        ),
        (
            "leader_arm=/nowhere.json",
            "/nowhere.json: cannot be read (No such file or directory); joshua calibrate",
        ),
        ("leader_arm=/dev/null", "is not valid JSON"),
    ],
)
def test_what_cannot_be_imported_is_said(
    config: str, tmp_path: Path, capsys: pytest.CaptureFixture[str], item: str, said: str
):
    assert main(["calibrate", "import-lerobot", item, "--config", config]) == 2
    assert said in capsys.readouterr().err
    assert not (tmp_path / "calibration").exists()


def test_a_calibration_of_other_motors_is_refused(
    lerobot: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    config = str(robot(tmp_path, "/dev/ttyACM0", mode="MODE_TEST", ids="1, 2, 3"))
    assert main(["calibrate", "import-lerobot", str(lerobot), "--config", config]) == 2
    assert "contains motors 1, 2, 3, 4, 5, 6, but leader_arm has 1, 2, 3" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("items", "said"),
    [
        (["follower_arm"], "no calibration of follower_arm; allowed: leader_arm"),
        (["leader_arm", "leader_arm"], "several arms need a file each: leader_arm=PATH"),
        (["leader_arm=/dev/null"], "/dev/null exists already: choose another name, or add --force"),
        (["leader_arm=/proc/none/x.json"], "/proc/none/x.json: cannot be written"),
    ],
)
def test_what_cannot_be_exported_is_said(
    config: str, lerobot: Path, capsys: pytest.CaptureFixture[str], items: list[str], said: str
):
    assert main(["calibrate", "export-lerobot", "--config", config]) == 2
    assert "the file contains no calibration: calibrate the arms first" in capsys.readouterr().err
    assert main(["calibrate", "import-lerobot", str(lerobot), "--config", config]) == 0
    assert main(["calibrate", "export-lerobot", *items, "--config", config]) == 2
    assert said in capsys.readouterr().err


def test_what_check_finds_is_exported_also_from_a_file_that_calibrates(
    lerobot: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    config = str(robot(tmp_path, "/dev/ttyACM0", mode="MODE_CALIBRATION"))
    assert main(["calibrate", "import-lerobot", str(lerobot), "--config", config]) == 0
    capsys.readouterr()
    assert main(["calibrate", "export-lerobot", "--config", config]) == 0
    assert json.loads(capsys.readouterr().out) == json.loads(lerobot.read_text())


def test_an_exchange_looks_at_no_arm(config: str, capsys: pytest.CaptureFixture[str]):
    assert main(["calibrate", "import-lerobot", "x", "--check", "--config", config]) == 2
    assert "--check and --recover have no effect here" in capsys.readouterr().err


def test_a_typing_error_in_the_file_is_shown(config: str, capsys: pytest.CaptureFixture[str]):
    Path(config).write_text("generel { }")
    assert main(["calibrate", "--config", config]) == 2
    assert "nothing was started" in capsys.readouterr().err
