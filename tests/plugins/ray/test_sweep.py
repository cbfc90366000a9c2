"""What ``joshua sweep`` refuses before it needs a cluster."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest
from joshua.cli.main import main

PRESETS = Path(__file__).resolve().parents[3] / "configs"
PPO = str(PRESETS / "training_rl_ppo.pbtxt")
RATE = "ai.training.rl_config.learning_rate"


@pytest.fixture(autouse=True)
def without_ray(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setitem(sys.modules, "ray", None)
    monkeypatch.chdir(tmp_path)


@pytest.mark.parametrize(
    ("words", "code", "said"),
    [
        ([PPO], 2, "joshua sweep: no field varies. Write a range, such as"),
        ([PPO, "--set", f"{RATE}=uniform(1)"], 2, "it takes two numbers. Write uniform(0.9,0.999)"),
        ([PPO, "--set", f"{RATE}=grid(0.1,2)"], 2, "learning_rate must be above 0, at most 1"),
        ([PPO, "--set", "ai.training.rl_config.learning_rat=grid(0.1,0.2)"], 2, "learning_rate"),
        ([PPO, "--set", f"{RATE}=grid(0.1,0.2)", "--ray", "10.0.0.1:6379"], 2, "is not on the loopback"),
        ([PPO, "--set", f"{RATE}=grid(0.1,0.2)"], 3, "requires Ray, which is not installed"),
        (
            [str(PRESETS / "test_mock_hardware.pbtxt"), "--set", "general.name=grid(a,b)"],
            2,
            "trains nothing whose settings could be compared",
        ),
    ],
)
def test_what_cannot_be_swept_is_said(
    words: list[str], code: int, said: str, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    assert main(["sweep", *words]) == code
    assert said in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_numbers_of_the_command_line_are_checked(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["sweep", PPO, "--trials", "0"])
    assert ended.value.code == 2
    assert "0 is less than 1" in capsys.readouterr().err
