"""Calibrating an emulated arm through the program: by keys, lines, the page and a script; interruptions."""

from __future__ import annotations

import json
import re
import signal
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from calibration_run import JOSHUA, CalibrationRun, Page, environment, robot, sweep_all
from joshua.testing.port import free_port
from joshua_emulator import EmulatedBus

CONFIGS = Path(__file__).parents[2] / "configs"


@pytest.fixture
def arm() -> Iterator[EmulatedBus]:
    with EmulatedBus(arm="so_arm100", identity="ARM1") as arm:
        yield arm


@pytest.fixture
def env(tmp_path: Path, joshua_domain_id: int) -> dict[str, str]:
    return environment(tmp_path, joshua_domain_id)


def joshua(env: dict[str, str], *words: str, timeout: float = 200) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [str(JOSHUA), *words],
        capture_output=True, text=True, timeout=timeout, stdin=subprocess.DEVNULL, env=env,
    )  # fmt: skip


def is_untouched(arm: EmulatedBus) -> bool:
    return {servo["homing_offset"] for servo in arm.servos()} == {0}


def never_energised(arm: EmulatedBus) -> bool:
    return not [entry for entry in arm.log("torque") if entry["on"]]


def test_keys_in_a_terminal_and_then_a_run_loads_it(
    arm: EmulatedBus, tmp_path: Path, env: dict[str, str]
) -> None:
    config = robot(tmp_path, arm.port)
    with CalibrationRun(["--config", str(config)], env, terminal=True) as run:
        sweep_all(run, arm, lambda: run.press("\r"))
        assert "[middle pose] > ranges > review > write" in run.text
        assert re.search(r"> 1 shoulder_pan +\[[·━●┊]+\] +[+-]\d", run.text)
        assert "Enter confirm   b back to the middle pose   1-9 repeat a joint   q quit" in run.text
        run.press("\n")
        assert run.end() == 0, run.text[-3000:]
    assert "calibrated: leader_arm." in run.text
    truth = arm.calibration()["motors"]
    half = {1: 1434, 2: 1089, 3: 1024, 4: 1239, 5: 1890, 6: 717}
    for motor in truth:
        middle = (motor["range_min"] + motor["range_max"]) / 2
        assert middle == pytest.approx(2048, abs=12)
        assert (motor["range_max"] - motor["range_min"]) / 2 == pytest.approx(half[motor["id"]], abs=8)
    assert never_energised(arm)
    checked = joshua(env, "calibrate", "--check", "--config", str(config))
    assert checked.returncode == 0, checked.stdout + checked.stderr
    assert checked.stdout.startswith("EQUAL  leader_arm")
    again = robot(tmp_path, arm.port, mode="MODE_TEST", more="test { duration_s: 3 }")
    used = joshua(env, "--config", str(again))
    assert "positions" in used.stdout, used.stdout + used.stderr
    assert "shoulder_pan" in joshua(env, "plan", "--config", str(again), "--format", "json").stdout


def test_lines_from_a_pipe_and_plain_output(arm: EmulatedBus, tmp_path: Path, env: dict[str, str]) -> None:
    with CalibrationRun(["--config", str(robot(tmp_path, arm.port))], env) as run:
        run.wait_for("middle of its range")
        run.press("7\n")
        run.wait_for("leader_arm: refused: This joint cannot be repeated at this step.")
        run.wait_for("Move shoulder_pan from", again=lambda: run.press("\n"))
        run.press("\n")
        run.wait_for("refused: shoulder_pan did not move")
        run.press("q\n")
        assert run.end() == 0
    assert "\x1b" not in run.text
    assert "not calibrated: leader_arm.\nNothing changed. The old calibration is still" in run.text
    assert is_untouched(arm)
    assert not (tmp_path / "calibration").exists()


def test_the_page_drives_it(arm: EmulatedBus, tmp_path: Path, env: dict[str, str]) -> None:
    config = robot(tmp_path, arm.port, more="calibration_run { display: true }")
    with CalibrationRun(["--config", str(config)], env) as run:
        run.wait_for("/\n")
        page = Page(re.findall(r"page: (\S+)", run.text)[0])
        sweep_all(run, arm, lambda: page.ask({"ask": "confirm"}))
        run.wait_until(
            lambda: page.board()["view"]["step"] == "review"
        )  # the page is told after the terminal
        board = page.board()
        assert [joint["state"] for joint in board["view"]["joints"]] == ["done"] * 6
        assert board["arms"] == [["leader_arm", "active"]]
        assert page.ask({"ask": "confirm"}) == 204
        assert run.end() == 0
    assert "calibrated: leader_arm." in run.text
    assert not is_untouched(arm)


def test_emulated_arms_go_through_it_by_themselves(tmp_path: Path, env: dict[str, str]) -> None:
    preset = tmp_path / "calibrate.pbtxt"
    preset.write_text((CONFIGS / "calibrate_so_arm100.pbtxt").read_text())
    teleop = tmp_path / "teleop.pbtxt"
    teleop.write_text((CONFIGS / "teleop_so_arm100.pbtxt").read_text())
    done = joshua(env, "calibrate", "--config", str(preset), "--emulate", "--node", "leader_arm")
    assert done.returncode == 0, done.stdout + done.stderr
    assert "the emulated arms perform all steps by themselves" in done.stdout
    assert "calibrated: leader_arm." in done.stdout
    assert "is mirrored: set inverted: true in its entry of" in done.stdout
    assert not (tmp_path / "calibration").exists(), "the file beside the configuration is that of real arms"
    (file,) = (tmp_path / "state").rglob("so-arm100.pbtxt")
    assert 'node_name: "leader_arm"' in file.read_text()
    own = ("--set", f'transport.listen_endpoints="tcp/localhost:{free_port()}"')
    run = joshua(env, "--config", str(teleop), "--emulate", "--duration", "1", *own)
    assert run.returncode == 0, run.stdout + run.stderr


@pytest.mark.parametrize("reads", [170, 255])
def test_an_unplug_in_the_midst_costs_no_range(tmp_path: Path, env: dict[str, str], reads: int) -> None:
    config = tmp_path / "calibrate.pbtxt"
    config.write_text((CONFIGS / "calibrate_so_arm100.pbtxt").read_text())
    words = ["--config", str(config), "--emulate", "--node", "leader_arm"]
    fault = f"leader_arm:unplug,after_reads={reads},replug_after_s=1"
    done = joshua(env, "calibrate", *words, "--fault", fault)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "No answer from the arm" in done.stdout
    (file,) = (tmp_path / "state").rglob("so-arm100.pbtxt")
    low, high = (
        [int(n) for n in re.findall(rf"range_{end}: (\d+)", file.read_text())] for end in ("min", "max")
    )
    spans = [b - a for a, b in zip(low, high, strict=True)]
    assert spans == pytest.approx([2868, 2178, 2048, 2477, 3781, 1434], abs=16)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGKILL])
def test_a_signal_leaves_everything_as_it_was(
    arm: EmulatedBus, tmp_path: Path, env: dict[str, str], number: signal.Signals
) -> None:
    with CalibrationRun(["--config", str(robot(tmp_path, arm.port))], env) as run:
        run.wait_for("middle of its range")
        run.process.send_signal(number)
        code = run.end()
    if number is not signal.SIGKILL:
        assert code == 0
        assert "stopped; not calibrated: leader_arm." in run.text
    assert is_untouched(arm)
    assert not (tmp_path / "calibration").exists()


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGINT])
def test_a_signal_after_all_the_work_writes_nothing(
    arm: EmulatedBus, tmp_path: Path, env: dict[str, str], number: signal.Signals
) -> None:
    with CalibrationRun(["--config", str(robot(tmp_path, arm.port))], env) as run:
        sweep_all(run, arm, lambda: run.press("\n"), seconds=0.6)
        run.process.send_signal(number)
        run.end()
    assert is_untouched(arm)
    assert not (tmp_path / "calibration").exists()


def test_status_and_stop_reach_it(arm: EmulatedBus, tmp_path: Path, env: dict[str, str]) -> None:
    config = str(robot(tmp_path, arm.port))
    with CalibrationRun(["--config", config, "--open"], {**env, "DISPLAY": "", "WAYLAND_DISPLAY": ""}) as run:
        run.wait_for("middle of its range")
        assert "no browser can be opened here" in run.text
        assert re.search(r"`ssh -L (\d+):127\.0\.0\.1:\1 HOST`", run.text)
        shown = joshua(env, "status")
        assert shown.returncode == 0, shown.stderr
        assert re.search(r"/leader_arm +ready +\d+\n +/leader_arm: calibration: active", shown.stdout)
        stopped = joshua(env, "stop")
        assert stopped.returncode == 0, stopped.stderr
        assert run.end() == 0
    assert "stopped; not calibrated: leader_arm." in run.text


def test_the_duration_ends_it(arm: EmulatedBus, tmp_path: Path, env: dict[str, str]) -> None:
    with CalibrationRun(["--config", str(robot(tmp_path, arm.port)), "--duration", "1"], env) as run:
        assert run.end() == 0
    assert "not calibrated: leader_arm." in run.text


def test_an_arm_that_is_unplugged_meanwhile_goes_on_afterwards(
    arm: EmulatedBus, tmp_path: Path, env: dict[str, str]
) -> None:
    with CalibrationRun(["--config", str(robot(tmp_path, arm.port))], env) as run:
        place = run.wait_for("middle of its range")
        arm.ask("fault", kind="unplug")
        place = run.wait_for("No answer from the arm", since=place)
        run.press("\n")
        arm.ask("fault", kind="replug")
        run.wait_for("The arm responds again.", since=place)
        run.wait_for("Move shoulder_pan from", since=place, again=lambda: run.press("\n"))
        run.press("q\n")
        assert run.end() == 0
    assert never_energised(arm)


def test_an_absent_arm_is_named_before_anything_begins(tmp_path: Path, env: dict[str, str]) -> None:
    with CalibrationRun(["--config", str(robot(tmp_path, "/dev/ttyNONE7"))], env) as run:
        assert run.end() == 4
    assert "leader_arm: /dev/ttyNONE7: no such serial port" in run.text
    assert "nothing was calibrated" in run.text


def test_missing_servos_are_named(arm: EmulatedBus, tmp_path: Path, env: dict[str, str]) -> None:
    arm.ask("fault", kind="break_after", value=4)
    with CalibrationRun(["--config", str(robot(tmp_path, arm.port))], env) as run:
        assert run.end() == 4
    assert "the chain breaks after id 4" in run.text


def test_a_second_run_of_the_same_arm_is_refused(
    arm: EmulatedBus, tmp_path: Path, env: dict[str, str]
) -> None:
    config = str(robot(tmp_path, arm.port))
    with CalibrationRun(["--config", config], env) as run:
        run.wait_for("middle of its range")
        with CalibrationRun(["--config", config], env) as second:
            assert second.end() == 4
        assert f"/leader_arm: held by process {run.process.pid}" in second.text
        run.press("q\n")
        assert run.end() == 0


def test_nobody_to_confirm_is_refused_on_real_arms(
    arm: EmulatedBus, tmp_path: Path, env: dict[str, str]
) -> None:
    result = joshua(env, "--config", str(robot(tmp_path, arm.port)))
    assert result.returncode == 2
    assert "no terminal to confirm in: run the command in a terminal, or add --open" in result.stderr


def test_a_broken_calibration_file_is_refused_before_the_work(
    arm: EmulatedBus, tmp_path: Path, env: dict[str, str]
) -> None:
    (tmp_path / "calibration").mkdir()
    (tmp_path / "calibration" / "rig.pbtxt").write_text("calibration { arms { node_nam: } }")
    with CalibrationRun(["--config", str(robot(tmp_path, arm.port))], env) as run:
        assert run.end() == 2
    assert "Correct the calibration file, or move it away" in run.text


def test_an_old_calibration_that_fits_no_more_does_not_keep_a_new_one_away(
    arm: EmulatedBus, tmp_path: Path, env: dict[str, str]
) -> None:
    entry = 'arms { node_name: "leader_arm" motors { id: 9 joint_name: "old" range_max: 9 } }'
    config = robot(tmp_path, arm.port, more=f"calibration {{ {entry} }}")
    with CalibrationRun(["--config", str(config)], env) as run:
        run.wait_for("middle of its range")
        run.press("q\n")
        assert run.end() == 0, run.text


def test_an_interrupted_write_keeps_runs_away_until_it_is_recovered(
    arm: EmulatedBus, tmp_path: Path, env: dict[str, str]
) -> None:
    old = {"homing_offset": 0, "range_min": 0, "range_max": 4095}
    half = {"homing_offset": 33, "range_min": 100, "range_max": 4000}
    arm.ask("set_register", id=1, name="homing_offset", value=33)
    note = {
        "node_name": "leader_arm",
        "device_identity": "",
        "calibrated_at": "2026-01-31T12:00:00Z",
        "old": {str(i): old for i in range(1, 7)},
        "new": {str(i): half for i in range(1, 7)},
    }
    (tmp_path / "calibration").mkdir()
    journal = tmp_path / "calibration" / "rig.leader_arm.interrupted.json"
    journal.write_text(json.dumps(note))
    config = str(robot(tmp_path, arm.port, mode="MODE_TEST"))
    refused = joshua(env, "--config", config)
    assert refused.returncode == 2
    assert "[calibration-interrupted]" in refused.stderr
    assert f"joshua calibrate --recover --config {config}" in " ".join(refused.stderr.split())
    recovered = joshua(env, "calibrate", "--recover", "--config", config)
    assert recovered.returncode == 0, recovered.stderr
    assert "the servos hold the old calibration again" in recovered.stdout
    assert is_untouched(arm)
    assert not journal.exists()
    assert "was interrupted" in joshua(env, "calibrate", "--recover", "--config", config).stdout


def test_one_arm_is_recovered_while_the_other_is_not_plugged_in(
    arm: EmulatedBus, tmp_path: Path, env: dict[str, str]
) -> None:
    path = robot(tmp_path, arm.port, mode="MODE_TEST")
    block = path.read_text().split("robot {", 1)[1].rsplit("}", 2)[0] + "}"
    second = block.replace("leader_arm", "other_arm").replace('"/leader"', '"/other"')
    second = second.replace("node_id: 1", "node_id: 2").replace(arm.port, "/dev/ttyACM77")
    path.write_text(path.read_text().replace("robot {", f"robot {{ {second}", 1))
    config = str(path)
    folder = tmp_path / "calibration"
    folder.mkdir()
    old, new = ({"homing_offset": n, "range_min": 0, "range_max": 4095} for n in (0, 33))
    note = {"device_identity": "", "calibrated_at": "2026-01-31T12:00:00Z"}
    note |= {"old": dict.fromkeys("123456", old), "new": dict.fromkeys("123456", new)}  # type: ignore[dict-item]
    journals = {name: folder / f"rig.{name}.interrupted.json" for name in ("leader_arm", "other_arm")}
    for name, journal in journals.items():
        journal.write_text(json.dumps({"node_name": name, **note}))
    (folder / ".rig.pbtxt.killed.new").write_text("left over")
    arm.ask("set_register", id=1, name="homing_offset", value=33)

    looked = joshua(env, "calibrate", "--check", "--config", config)
    assert "leader_arm: a calibration was interrupted while it was written. Run" in looked.stdout

    recovered = joshua(env, "calibrate", "--recover", "--config", config)
    assert "leader_arm: an earlier calibration was interrupted; the servos hold the old" in recovered.stdout
    assert recovered.returncode == 4
    hint = f"joshua calibrate --recover --config {config} --node other_arm"
    assert f"Connect other_arm and run `{hint}`." in recovered.stderr
    assert is_untouched(arm)
    assert not journals["leader_arm"].exists()
    assert not list(folder.glob(".*.new"))
    again = joshua(env, *hint.split()[1:])  # the hint runs, and says what it needs
    assert again.returncode == 4
    assert "/dev/ttyACM77" in again.stderr
    assert "joshua calibrate: other_arm" in again.stderr


def test_check_names_every_difference(arm: EmulatedBus, tmp_path: Path, env: dict[str, str]) -> None:
    config = str(robot(tmp_path, arm.port, mode="MODE_TEST"))
    nothing = joshua(env, "calibrate", "--check", "--config", config)
    assert nothing.returncode == 1
    assert "the file contains no calibration of this arm" in nothing.stdout
    write_file(tmp_path, arm.calibration()["motors"])
    arm.ask("set_register", id=4, name="homing_offset", value=12)
    found = joshua(env, "calibrate", "--check", "--config", config)
    assert found.returncode == 1
    assert "! wrist_flex (id 4): homing_offset is 0 in the file and 12 in the servo" in found.stdout
    assert "Calibrate the arm again, or include the file that belongs to it." in found.stdout
    assert is_untouched(arm) is False
    refused = joshua(env, "--config", config)
    assert refused.returncode == 4
    assert "the calibration does not match these servos" in refused.stdout + refused.stderr


def test_check_without_the_arm(tmp_path: Path, env: dict[str, str]) -> None:
    result = joshua(env, "calibrate", "--check", "--config", str(robot(tmp_path, "/dev/ttyNONE7")))
    assert result.returncode == 4
    assert "no such serial port" in result.stderr


def write_file(folder: Path, motors: list[dict[str, Any]]) -> Path:
    rows = " ".join(
        f'motors {{ id: {m["id"]} joint_name: "{m["joint_name"]}" homing_offset: {m["homing_offset"]} '
        f"range_min: {m['range_min']} range_max: {m['range_max']} }}"
        for m in motors
    )
    path = folder / "calibration" / "rig.pbtxt"
    path.parent.mkdir(exist_ok=True)
    path.write_text(f'calibration {{ arms {{ node_name: "leader_arm" {rows} }} }}')
    return path


def test_a_folder_that_cannot_be_written_is_refused_before_the_work(
    arm: EmulatedBus, tmp_path: Path, env: dict[str, str]
) -> None:
    (tmp_path / "calibration").write_text("a file where the folder should be")
    with CalibrationRun(["--config", str(robot(tmp_path, arm.port))], env) as run:
        assert run.end() == 2
    assert "calibration is not a folder. Correct that" in run.text


def test_a_write_that_fails_is_undone_and_said(arm: EmulatedBus, tmp_path: Path, env: dict[str, str]) -> None:
    with CalibrationRun(["--config", str(robot(tmp_path, arm.port))], env) as run:
        sweep_all(run, arm, lambda: run.press("\n"), seconds=0.6)
        (tmp_path / "calibration").write_text("a file where the folder should be")
        place = len(run.text)
        run.press("\n")
        place = run.wait_for("Nothing was written. The old calibration is still used.", since=place)
        (tmp_path / "calibration").unlink()
        run.press("\n")
        run.wait_for("leader_arm is calibrated", since=place)
        assert run.end() == 0
    assert not is_untouched(arm)
