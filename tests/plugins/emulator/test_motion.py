from pathlib import Path

import pytest
from joshua_emulator import motion


def test_a_sine_starts_at_the_centre_and_stays_within_its_amplitude() -> None:
    paths = motion.sine({"amplitude_rad": 0.4, "frequency_hz": 1.0, "center_rad": 0.1}, ["a", "b"])
    assert paths[0](0.0) == paths[1](0.0) == pytest.approx(0.1)
    values = [paths[0](time / 100) for time in range(500)]
    assert max(values) == pytest.approx(0.5, abs=0.01)
    assert min(values) == pytest.approx(-0.3, abs=0.01)


def test_a_sweep_visits_both_stops_one_joint_at_a_time() -> None:
    paths = motion.sweep({"seconds_per_joint": 2.0}, [(-1.0, 1.0), (-0.5, 2.0)])
    assert (paths[0](0.5), paths[0](1.5)) == (-1.0, 1.0)
    assert {paths[1](time / 10) for time in range(20)} == {0.75}
    assert (paths[1](2.5), paths[1](3.5)) == (-0.5, 2.0)


def test_a_recording_is_interpolated(tmp_path: Path) -> None:
    file = tmp_path / "wave.csv"
    file.write_text("time_s,joint_2,shoulder\n0,0.0,1.0\n2,1.0,1.0\n")
    paths = motion.recorded({"file": str(file)}, ["shoulder", "elbow"])
    assert paths[1](1.0) == pytest.approx(0.5)
    assert paths[0](9.0) == 1.0


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("joint_1\n1\n", "the header must begin with time_s"),
        ("time_s,joint_1\n", "a line of numbers must follow"),
        ("time_s,joint_1\n0,x\n", "not a table of numbers"),
        ("time_s,joint_1\n0,1\n0,2\n", "must rise from line to line"),
        ("time_s,joint_1\n0\n", "every line needs 2 numbers"),
        ("time_s,wrist\n0,1\n", "no joint is called 'wrist'; allowed: a, joint_1"),
    ],
)
def test_a_bad_recording_is_refused(tmp_path: Path, text: str, message: str) -> None:
    file = tmp_path / "bad.csv"
    file.write_text(text)
    with pytest.raises(motion.MotionError, match=message):
        motion.recorded({"file": str(file)}, ["a"])


def test_an_absent_recording_and_wrong_settings_are_refused(tmp_path: Path) -> None:
    with pytest.raises(motion.MotionError, match="name an existing CSV file"):
        motion.recorded({"file": str(tmp_path / "none.csv")}, ["a"])
    with pytest.raises(motion.MotionError, match="unknown setting 'speed'; allowed: amplitude_rad"):
        motion.sine({"speed": 1}, ["a"])
    with pytest.raises(motion.MotionError, match="a finite number"):
        motion.sine({"amplitude_rad": float("inf")}, ["a"])
