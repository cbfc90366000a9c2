"""Whole runs of imitation: stopped, killed and continued, they learn as if nothing had happened."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import psutil
import pytest
from hub_server import TOKEN, HubServer, Repository
from joshua.testing.domain import reserved_domain
from joshua.testing.port import free_port
from programs import program
from safetensors.numpy import load_file
from serving import serving
from tiny_recordings import write_recording

POLICY, TRAINING, STATE = "pretrained_model", "training.safetensors", "state.json"

TRAIN = """
general {{ mode: MODE_TRAINING name: "train" id: "train-{name}" }}
ai {{
  {store}
  training {{
    environment: ENV_SIMULATION method: METHOD_IMITATION
    imitation_config {{
      dataset_name: "{dataset}" num_epochs: {epochs} learning_rate: 0.001 batch_size: 4 chunk_size: 8
      hidden_size: 32 feedforward_size: 32 encoder_layers: 1 report_steps: 1 validation_steps: 4
      checkpoint_steps: 4 threads: 1 device: "cpu" output_folder: "{name}" {more}
    }}
  }}
}}
"""
STORE = """
  data_store {{
    format: FORMAT_HUGGINGFACE storage: STORAGE_LOCAL dataset_name: "demos" local_path: "{place}"
  }}
"""


def start(
    folder: Path, name: str, dataset: Path, *, epochs: int = 4, more: str = ""
) -> subprocess.Popen[str]:
    path = folder / f"{name}{len(more)}.pbtxt"
    store = STORE.format(place=dataset)
    path.write_text(TRAIN.format(name=name, store=store, dataset="demos", epochs=epochs, more=more))
    with reserved_domain() as domain:
        return subprocess.Popen(
            [sys.executable, "-m", "joshua.cli.main", "--config", str(path)],
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            start_new_session=True,
            env={
                **os.environ,
                "ROS_DOMAIN_ID": str(domain),
            },
        )


def ended(run: subprocess.Popen[str], code: int = 0) -> str:
    said, _ = run.communicate(timeout=250)
    assert run.returncode == code, said
    assert "Traceback" not in said
    return said


def until(folder: Path, checkpoints: int) -> None:
    deadline = time.monotonic() + 200
    while time.monotonic() < deadline and len(list(folder.glob("*/checkpoints/step_*"))) < checkpoints:
        time.sleep(0.02)


def curve(run: Path) -> list[dict[str, float]]:
    found = [json.loads(line) for line in (run / "metrics.jsonl").read_text().splitlines()]
    return [{key: value for key, value in row.items() if not key.startswith("rate/")} for row in found]


def test_a_stopped_and_a_killed_run_go_on_as_if_nothing_had_happened(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    place = tmp_path / "temporary"
    place.mkdir()
    monkeypatch.setenv("TMPDIR", str(place))
    recording = write_recording(tmp_path / "recording")
    said = ended(start(tmp_path, "whole", recording))
    assert "24 updates learned: loss" in said
    run = start(tmp_path, "broken", recording)
    until(tmp_path / "broken", 1)
    os.killpg(run.pid, signal.SIGINT)
    said = ended(run)
    (folder,) = (tmp_path / "broken").iterdir()
    assert f"checkpoint {folder}" in said.replace("\n", "")
    more = f'resume_run: "broken/{folder.name}"'
    run = start(tmp_path, "broken", recording, more=more)
    until(tmp_path / "broken", 3)
    os.killpg(run.pid, signal.SIGKILL)
    run.communicate()
    said = ended(start(tmp_path, "broken", recording, more=more))
    assert "continuing after" in said
    (other,) = (tmp_path / "whole").iterdir()
    assert curve(folder) == curve(other)
    assert [path.name for path in (tmp_path / "broken").iterdir()] == [folder.name]
    last = [max((path / "checkpoints").iterdir()) for path in (folder, other)]
    for name in (f"{POLICY}/model.safetensors", TRAINING, STATE):
        assert (last[0] / name).read_bytes() == (last[1] / name).read_bytes(), name
    assert list(place.glob("joshua-*")) == []  # those of the killed one, too
    log = (folder / "run.log").read_text()
    assert log.count("INFO continuing after") == 2
    assert "INFO 24 updates learned: loss" in log
    assert len(list(folder.glob("config_*.pbtxt"))) == 2
    assert (folder / "curves.svg").is_file()
    assert list((folder / "tensorboard").glob("*tfevents*"))
    facts = json.loads((folder / "run.json").read_text())
    assert (facts["policy"], facts["settings"]["batch_size"]) == ("act", 4)
    assert {"joshua-imitation", "lerobot", "torch"} <= set(facts["versions"])
    changed = start(tmp_path, "broken", recording, more=f"{more} seed: 5")
    assert "the run was started with seed 0, but the file says 5" in ended(changed, 1).replace("\n", " ")


def test_two_processes_learn_as_one_does_with_twice_the_batches(tmp_path: Path) -> None:
    recording = write_recording(tmp_path / "recording")
    ended(start(tmp_path, "alone", recording, more="accumulation_steps: 2"))
    run = start(tmp_path, "together", recording, more="processes: 2")
    until(tmp_path / "together", 1)
    os.killpg(run.pid, signal.SIGINT)
    said = ended(run)
    assert "2 processes learn together" in said
    (folder,) = (tmp_path / "together").iterdir()
    said = ended(start(tmp_path, "together", recording, more=f'processes: 2 resume_run: "{folder}"'))
    assert "continuing after" in said
    assert "12 updates learned" in said
    (other,) = (tmp_path / "alone").iterdir()
    same(folder, other)


def test_a_killed_process_ends_the_training_with_its_reason(tmp_path: Path) -> None:
    recording = write_recording(tmp_path / "recording")
    run = start(tmp_path, "together", recording, epochs=100000, more="processes: 2")
    until(tmp_path / "together", 1)
    (worker,) = (
        process
        for process in psutil.process_iter(["cmdline"])
        if "joshua_imitation.worker" in (process.info["cmdline"] or ()) and os.getsid(process.pid) == run.pid
    )
    worker.kill()
    said = " ".join(ended(run, 1).split())
    assert "a process of this training failed: it was ended by signal 9" in said
    (folder,) = (tmp_path / "together").iterdir()
    assert list((folder / "checkpoints").glob("step_*"))


def test_two_machines_learn_together(tmp_path: Path) -> None:
    recording = write_recording(tmp_path / "recording")
    fields = f'max_steps: 3 machines: 2 main_address: "127.0.0.1:{free_port()}"'
    second = start(tmp_path, "second", recording, more=f"{fields} machine_rank: 1")
    ended(start(tmp_path, "first", recording, more=fields))
    ended(second)
    ended(start(tmp_path, "alone", recording, more="accumulation_steps: 2 max_steps: 3"))
    folders = [next((tmp_path / name).iterdir()) for name in ("first", "second", "alone")]
    same(folders[0], folders[1])
    same(folders[0], folders[2])


def test_a_data_set_on_the_hub_is_fetched_and_learned(tmp_path: Path) -> None:
    recording = write_recording(tmp_path / "recording")
    files = {
        path.relative_to(recording).as_posix(): path.read_bytes()
        for path in recording.rglob("*")
        if path.is_file()
    }
    server = HubServer()
    server.repositories["me/demos"] = Repository(
        private=True, branches={"main": files}, tags={"v3.0": "main"}
    )
    (tmp_path / "train.pbtxt").write_text(
        TRAIN.format(name="fetched", store="", dataset="me/demos", epochs=1, more="max_steps: 1")
    )
    home = tmp_path / "home"
    environment = {
        **{"HF_ENDPOINT": f"http://127.0.0.1:{server.port}", "HF_TOKEN": TOKEN, "HF_HUB_OFFLINE": "0"},
        **{"HF_HOME": str(home), "HF_LEROBOT_HOME": str(home / "lerobot"), "HF_HUB_DISABLE_XET": "1"},
    }
    with serving(server), program(tmp_path, environment) as joshua:
        said = joshua.run("train")
    assert "1 updates learned" in said
    assert "Fetching" not in said
    assert (home / "lerobot/me/demos/meta/info.json").read_bytes() == files["meta/info.json"]
    (run,) = (tmp_path / "fetched").iterdir()
    assert json.loads((run / "run.json").read_text())["settings"]["dataset"] == "me/demos"
    (policy,) = run.glob(f"checkpoints/*/{POLICY}")
    assert json.loads((policy / "dataset.json").read_text())["fps"] == 10


def same(one: Path, other: Path) -> None:
    """Both runs have the same curve and the same weights, but for the order of additions."""
    for row, expected in zip(curve(one), curve(other), strict=True):
        assert row == pytest.approx(expected, rel=1e-4, abs=1e-6)
    weights = [
        load_file(max((run / "checkpoints").iterdir()) / POLICY / "model.safetensors") for run in (one, other)
    ]
    assert weights[0].keys() == weights[1].keys()
    for name, values in weights[0].items():
        np.testing.assert_allclose(values, weights[1][name], rtol=1e-3, atol=2e-5, err_msg=name)
