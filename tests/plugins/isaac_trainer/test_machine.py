"""What is missing for Isaac Lab is said exactly, and nothing else."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from joshua_isaac_trainer import machine
from joshua_isaac_trainer.machine import UNFIT, Gpu, Machine, gpus_of, lacks, look

READY = Machine(
    system="Linux",
    architecture="x86_64",
    python=(3, 11),
    isaac_sim="5.1.0.0",
    isaac_lab="2.3.2.post1",
    rsl_rl="3.0.1",
    driver="580.95.05",
    gpus=(Gpu("NVIDIA GeForce RTX 4090", 24_564),),
    eula=True,
)


def said(found: Machine) -> list[str]:
    return [lack.message for lack in lacks(found)]


def test_a_machine_with_everything_lacks_nothing() -> None:
    assert said(READY) == []
    assert said(replace(READY, isaac_lab="0.54.2", isaac_sim="", rsl_rl="")) == []
    assert said(replace(READY, python=(3, 10), isaac_sim="4.5.0.0", driver="535.183.01")) == []


@pytest.mark.parametrize(
    ("change", "message", "remedy", "code"),
    [
        ({"isaac_sim": None}, "Isaac Sim is not installed for Python 3.11", "Isaac Sim 5.1", "extra-missing"),
        ({"isaac_sim": "4.2.0"}, "Isaac Sim 4.2.0 is not supported", "4.5 or 5.0 or 5.1", "extra-missing"),
        ({"isaac_sim": "6.2.0.0"}, "Isaac Sim 6.2.0.0 is not supported", "4.5 or 5.0", "extra-missing"),
        (
            {"python": (3, 12)},
            "Isaac Sim 5.1 requires Python 3.11, and this is Python 3.12",
            "with Python 3.11",
            "extra-missing",
        ),
        ({"isaac_lab": None}, "Isaac Lab is not installed", "Isaac Lab 2.3", "extra-missing"),
        ({"isaac_lab": "3.0.0"}, "Isaac Lab is 3.0.0", "v2.3", "extra-missing"),
        ({"isaac_lab": "0.36.0"}, "Isaac Lab is 0.36.0", "v2.3", "extra-missing"),
        ({"rsl_rl": None}, "rsl_rl is not installed", "joshua-isaac-trainer[learn]", "extra-missing"),
        ({"rsl_rl": "5.5.1"}, "rsl_rl is 5.5.1", "rsl-rl-lib>=3.0.1,<4", "extra-missing"),
        ({"driver": None, "gpus": ()}, "There is no NVIDIA driver", "BACKEND_MUJOCO needs no GPU", UNFIT),
        ({"gpus": ()}, "The NVIDIA driver 580.95.05 shows no GPU", "--gpus all", UNFIT),
        (
            {"driver": "550.54.14"},
            "The NVIDIA driver is 550.54.14, and Isaac Sim 5.1 requires 580.65.06",
            "Update the driver",
            UNFIT,
        ),
        ({"gpus": (Gpu("NVIDIA T600", 4096),)}, "NVIDIA T600 has 4096 MB", "another machine", UNFIT),
        ({"eula": False}, "licence agreement for Omniverse is not accepted", "OMNI_KIT_ACCEPT_EULA", UNFIT),
        ({"system": "Darwin", "architecture": "arm64"}, "not on Darwin arm64", "Linux machine", UNFIT),
    ],
)
def test_each_lack_has_its_message(change, message: str, remedy: str, code: str) -> None:
    (lack,) = lacks(replace(READY, **change))
    assert message in lack.message
    assert remedy in lack.remedy
    assert lack.code == code


def test_a_python_without_any_release_names_those_that_have_one() -> None:
    (lack,) = lacks(replace(READY, isaac_sim=None, python=(3, 13)))
    assert "Python 3.10 (Isaac Sim 4.5) or Python 3.11 (Isaac Sim 5.0, 5.1)" in lack.remedy


def test_the_answer_of_nvidia_smi_is_read() -> None:
    assert gpus_of("NVIDIA RTX A6000, 49140\nNVIDIA L4, 23034\n") == (
        Gpu("NVIDIA RTX A6000", 49140),
        Gpu("NVIDIA L4", 23034),
    )
    assert gpus_of("NVIDIA-SMI has failed because it could not communicate with the driver.\n") == ()


def test_the_version_of_the_driver_is_read(tmp_path: Path) -> None:
    path = tmp_path / "version"
    assert machine._driver(path) is None
    path.write_text(
        "NVRM version: NVIDIA UNIX x86_64 Kernel Module  580.95.05  Tue Sep 23 10:11:16 UTC 2025\n"
    )
    assert machine._driver(path) == "580.95.05"
    path.write_text("NVRM version: NVIDIA UNIX Open Kernel Module for x86_64  570.124.06  Release Build\n")
    assert machine._driver(path) == "570.124.06"


def test_an_accepted_licence_is_found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    package = tmp_path / "isaacsim"
    package.mkdir()
    (package / "__init__.py").write_text("raise AssertionError('the check imports Isaac Sim')\n")
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.delenv("OMNI_KIT_ACCEPT_EULA", raising=False)
    assert not look().eula
    assert look().isaac_sim == ""
    (package / "kit").mkdir()
    (package / "kit" / "EULA_ACCEPTED").write_text("no\n")
    assert not look().eula
    (package / "kit" / "EULA_ACCEPTED").write_text("Yes\n")
    assert look().eula
    (package / "kit" / "EULA_ACCEPTED").unlink()
    monkeypatch.setenv("OMNI_KIT_ACCEPT_EULA", "YES")
    assert look().eula
