"""The checks of the machine, on real file trees."""

from __future__ import annotations

from pathlib import Path

import pytest
from joshua.cli.doctor.checks import CHECKS, check_realtime, check_shared_memory, check_software
from joshua.cli.doctor.host import Host
from joshua.cli.doctor.result import DoctorResult, Level
from usb_host import MakeHost

LIMITS = """Limit                     Soft Limit           Hard Limit           Units
Max nice priority         0                    0
Max realtime priority     {0}                    {0}
Max locked memory         {1}              {1}              bytes
"""


def only(results: object) -> DoctorResult:
    (result,) = list(results)  # type: ignore[call-overload]
    return result


@pytest.mark.parametrize(("granted", "level"), [("0", Level.NOTE), ("1", Level.OK), ("unlimited", Level.OK)])
def test_the_grant_of_real_time_priority(make_host: MakeHost, granted: str, level: Level) -> None:
    found, _ = check_realtime(make_host({"proc/self/limits": LIMITS.format(granted, "unlimited")}))
    assert found.level is level
    assert ("rtprio 1" in found.remedy) is (level is Level.NOTE)


@pytest.mark.parametrize(("granted", "level"), [("8388608", Level.NOTE), ("unlimited", Level.OK)])
def test_the_grant_of_locked_memory(make_host: MakeHost, granted: str, level: Level) -> None:
    _, found = check_realtime(make_host({"proc/self/limits": LIMITS.format("1", granted)}))
    assert found.level is level
    assert ("memlock unlimited" in found.remedy) is (level is Level.NOTE)


def test_shared_memory_needs_a_place_and_room(tmp_path: Path, make_host: MakeHost) -> None:
    (tmp_path / "proc").mkdir()
    found = only(check_shared_memory(make_host()))
    assert (found.level, found.message) == (Level.ERROR, "does not exist")
    (tmp_path / "dev/shm").mkdir(parents=True)
    assert only(check_shared_memory(make_host(), least_mib=0)).level is Level.OK
    found = only(check_shared_memory(make_host(), least_mib=1e12))
    assert found.level is Level.WARNING
    assert "docker run --shm-size" in found.remedy


def test_the_software_is_listed_with_its_versions(make_host: MakeHost) -> None:
    found = list(check_software(make_host()))
    assert found[0].subject == "joshua-core"
    assert " on Python 3." in found[0].message
    assert all(result.level is Level.OK for result in found if result.subject == "joshua-sts3215")
    subjects = [result.subject for result in found]
    assert len(set(subjects)) == len(subjects), "each distribution once"


def test_every_check_bears_a_machine_without_any_of_its_files(make_host: MakeHost) -> None:
    assert all(result.level in (Level.OK, Level.NOTE) for check in CHECKS for result in check(make_host()))


def test_this_machine_can_be_looked_at() -> None:
    assert [result for check in CHECKS for result in check(Host())]
