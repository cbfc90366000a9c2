"""Which clusters may be used, without Ray."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
from joshua.cli.main import main
from joshua_jobs.executor import JobError
from joshua_ray import addresses, executor

ROOT = Path(__file__).resolve().parents[3]


@pytest.mark.parametrize(
    "address", ["local", "127.0.0.1:6379", "localhost:6379", "[::1]:6379", "127.8.0.1:1"]
)
def test_the_loopback_needs_nothing(address: str) -> None:
    addresses.check(address, {})


@pytest.mark.parametrize(
    ("address", "said"),
    [
        ("ray://127.0.0.1:10001", "Ray's client protocol is not supported. Make this machine a node"),
        ("127.0.0.1", "not an address. Write HOST:PORT of the head, such as 127.0.0.1:6379"),
        ("127.0.0.1:0", "not an address"),
        ("127.0.0.1:65536", "not an address"),
        ("127.0.0.1:6379;rm", "not an address"),
        ("", "not an address"),
    ],
)
def test_what_is_no_address_is_refused(address: str, said: str) -> None:
    with pytest.raises(JobError, match=said) as caught:
        addresses.check(address, {})
    assert caught.value.exit_code == 2


def protected(folder: Path) -> dict[str, str]:
    (folder / "token").write_text("secret\n")
    found = {
        "HOME": str(folder / "home"),
        "RAY_AUTH_MODE": "token",
        "RAY_AUTH_TOKEN_PATH": str(folder / "token"),
        "RAY_USE_TLS": "1",
    }
    for name in addresses.TLS_FILES:
        (folder / name).write_text("")
        found[name] = str(folder / name)
    return found


@pytest.mark.parametrize(
    "address", ["192.168.1.7:6379", "head.lab:6379", "0.0.0.0:6379", "127.0.0.1.lab:6379"]
)
def test_off_the_loopback_token_and_tls_are_required(tmp_path: Path, address: str) -> None:
    environment = protected(tmp_path)
    addresses.check(address, environment)
    for name in environment.keys() - {"HOME"}:
        without = {key: value for key, value in environment.items() if key != name}
        with pytest.raises(JobError, match="is not on the loopback") as caught:
            addresses.check(address, without)
        missing = "a token" if name == "RAY_AUTH_TOKEN_PATH" else name
        assert f"missing: {missing}" in str(caught.value)
        assert caught.value.exit_code == 2
    (tmp_path / "token").write_text(" \n")
    with pytest.raises(JobError, match="missing: a token"):
        addresses.check(address, environment)
    (tmp_path / "RAY_TLS_CA_CERT").unlink()
    with pytest.raises(JobError, match=r"RAY_TLS_CA_CERT \(a file\)"):
        addresses.check(address, environment)


def test_the_token_of_the_home_folder_counts(tmp_path: Path) -> None:
    environment = protected(tmp_path)
    del environment["RAY_AUTH_TOKEN_PATH"]
    (tmp_path / "home/.ray").mkdir(parents=True)
    (tmp_path / "home/.ray/auth_token").write_text("secret")
    addresses.check("10.0.0.1:6379", environment)


def test_a_missing_ray_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "ray", None)
    with pytest.raises(
        JobError, match=r"requires Ray, which is not installed: install joshua-ray\[cluster\]"
    ) as caught:
        executor.check("127.0.0.1:6379")
    assert caught.value.exit_code == 3


def test_a_data_set_command_says_why_it_refuses_a_cluster(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("RAY_AUTH_MODE", "RAY_USE_TLS"):
        monkeypatch.delenv(name, raising=False)
    assert main(["dataset", "check", str(tmp_path), "--ray", "10.0.0.1:6379"]) == 2
    said = capsys.readouterr().err
    assert said.startswith(
        "joshua dataset check: --ray 10.0.0.1:6379 is not on the loopback, and whoever reaches"
    )


def test_no_node_of_a_robot_loads_ray() -> None:
    """Only commands on data sets, trainings and evaluations know executors."""
    knowing = {
        path.relative_to(ROOT / "joshua-plugins").parts[0]
        for path in (ROOT / "joshua-plugins").glob("*/src/**/*.py")
        if "joshua_jobs" in path.read_text(encoding="utf-8")
    }
    assert knowing == {"dataset", "evaluation", "imitation", "jobs", "ppo-trainer", "ray", "training"}
    loading = {
        path.relative_to(ROOT / "joshua-plugins").as_posix()
        for path in (ROOT / "joshua-plugins").glob("*/src/**/*.py")
        if any(line.strip().startswith(("import ray", "from ray")) for line in path.read_text().splitlines())
    }
    names = ("cluster", "fitting", "joining", "together", "trial", "tuning")
    assert loading == {f"ray/src/joshua_ray/{name}.py" for name in names}
    code = "import sys, joshua_ray.executor; print('ray' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "False"
