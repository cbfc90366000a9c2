"""Weights & Biases and MLflow by their own libraries: a run is recorded, a lost server stops nothing."""

from __future__ import annotations

import json
import logging
import os
import socket
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

import pytest
from joshua_training import tracking
from joshua_training.run_folder import RunError, RunFolder
from joshua_training.tracking import Trackers, services_of
from joshua_training.tracking_settings import MlflowSettings, TrackingSettings, WandbSettings

LOG = logging.getLogger("test_tracking")


@pytest.fixture(autouse=True)
def own_environment(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    for name in [name for name in os.environ if name.startswith(("WANDB_", "MLFLOW_"))]:
        monkeypatch.delenv(name)
    monkeypatch.setenv("WANDB_CONFIG_DIR", str(tmp_path / "config"))
    monkeypatch.setenv("WANDB_CACHE_DIR", str(tmp_path / "cache"))
    monkeypatch.setenv("MLFLOW_HTTP_REQUEST_MAX_RETRIES", "1")
    monkeypatch.setenv("MLFLOW_HTTP_REQUEST_TIMEOUT", "5")
    monkeypatch.setenv("MLFLOW_ALLOW_FILE_STORE", "true")
    monkeypatch.setenv("MLFLOW_DISABLE_TELEMETRY", "true")
    monkeypatch.setattr(tracking, "RETRY_S", 0.1)
    monkeypatch.setattr(tracking, "CLOSE_S", 30.0)


def run_in(parent: Path) -> RunFolder:
    facts = {"environment": "joshua/SoArm100Reach-v0", "seed": 1, "settings": {"gamma": 0.9, "n_steps": 32}}
    return RunFolder.create(parent / "runs", "SoArm100Reach-v0", facts)


def recorded(folder: RunFolder, settings: TrackingSettings, steps: range = range(1, 6)) -> None:
    trackers = Trackers(services_of(settings, folder.path.parent), LOG)
    trackers.start(folder)
    for step in steps:
        trackers.add({"steps": step, "episode/return": step * 1.5, "train/loss": 1.0 / step}, step)
    trackers.close(True)


def records(path: Path) -> Iterator[bytes]:
    """Read the records of a file of Weights & Biases: LevelDB's log behind a header of seven bytes."""
    content, place, parts = path.read_bytes(), 7, b""
    assert content.startswith(b":W&B")
    while place + 7 <= len(content):
        left = 32768 - place % 32768
        if left < 7:
            place += left
            continue
        size, kind = int.from_bytes(content[place + 4 : place + 6], "little"), content[place + 6]
        parts += content[place + 7 : place + 7 + size]
        place += 7 + size
        if kind in (1, 4):  # whole, or the last part
            yield parts
            parts = b""


def test_wandb_writes_an_offline_run_into_its_folder(tmp_path: Path) -> None:
    from wandb.proto.wandb_internal_pb2 import Record

    folder = run_in(tmp_path)
    recorded(folder, TrackingSettings(wandb=WandbSettings(project="arm", offline=True)))
    (path,) = folder.path.glob("wandb/offline-run-*/run-*.wandb")
    history: dict[str, list[float]] = {}
    config: dict[str, Any] = {}
    projects, codes = [], []
    for content in records(path):
        record = Record()
        record.ParseFromString(content)
        for item in record.history.item:
            name = item.key or "/".join(item.nested_key)
            history.setdefault(name, []).append(json.loads(item.value_json))
        if record.HasField("run"):
            projects.append(record.run.project)
            config |= {item.key: json.loads(item.value_json) for item in record.run.config.update}
        if record.HasField("exit"):
            codes.append(record.exit.exit_code)
    assert history["episode/return"] == [1.5, 3.0, 4.5, 6.0, 7.5]
    assert history["_step"] == [1, 2, 3, 4, 5]
    assert projects[0] == "arm"
    assert (config["gamma"], config["seed"]) == ("0.9", "1")
    assert codes == [0]


def test_wandb_refuses_a_wrong_server_before_anything_is_learned(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("WANDB_API_KEY", "0" * 40)
    monkeypatch.setattr("joshua_training.wandb_service.START_S", 3.0)
    settings = TrackingSettings(wandb=WandbSettings(server="http://127.0.0.1:9"))
    trackers = Trackers(services_of(settings, tmp_path), LOG)
    with pytest.raises(RunError, match=r"Weights & Biases cannot record this run: .*offline: true"):
        trackers.start(run_in(tmp_path))


def test_mlflow_keeps_runs_in_a_folder_and_continues_them(tmp_path: Path) -> None:
    from mlflow.tracking import MlflowClient

    folder = run_in(tmp_path)
    settings = TrackingSettings(mlflow=MlflowSettings(experiment="arm"))
    recorded(folder, settings)
    recorded(folder, settings, range(4, 8))  # from a checkpoint before the last rows
    client = MlflowClient(tracking_uri=(tmp_path / "mlruns").as_uri())
    experiment = client.get_experiment_by_name("arm")
    (run,) = client.search_runs([experiment.experiment_id])
    assert run.info.run_name == folder.path.name
    assert run.info.status == "FINISHED"
    assert {"gamma": "0.9", "environment": "joshua/SoArm100Reach-v0"}.items() <= run.data.params.items()
    returns = client.get_metric_history(run.info.run_id, "episode/return")
    assert [(item.step, item.value) for item in returns] == [(k, k * 1.5) for k in range(1, 8)]


class Server:
    """What MLflow's client sends to a tracking server, over HTTP."""

    def __init__(self) -> None:
        with socket.create_server(("127.0.0.1", 0)) as free:
            self.port = free.getsockname()[1]
        self.metrics: list[tuple[str, float, int]] = []
        self.status = ""

    @contextmanager
    def running(self) -> Iterator[None]:
        outer = self
        info = {"run_id": "r1", "run_uuid": "r1", "experiment_id": "7", "status": "RUNNING"}

        class Handler(BaseHTTPRequestHandler):
            def do_GET(self) -> None:
                if "runs/get" in self.path:
                    self.answer({"run": {"info": info, "data": {}}})
                    return
                self.answer({"error_code": "RESOURCE_DOES_NOT_EXIST", "message": "none"}, 404)

            def do_POST(self) -> None:
                body = json.loads(self.rfile.read(int(self.headers["Content-Length"])))
                kind = self.path.rpartition("mlflow/")[2]
                if kind == "experiments/create":
                    self.answer({"experiment_id": "7"})
                elif kind == "runs/create":
                    self.answer({"run": {"info": info, "data": {}}})
                elif kind == "runs/log-batch":
                    outer.metrics += [(m["key"], m["value"], int(m["step"])) for m in body.get("metrics", [])]
                    self.answer({})
                else:
                    outer.status = body.get("status", "")
                    self.answer({"run_info": {"run_id": "r1", "status": outer.status}})

            def answer(self, content: dict[str, Any], code: int = 200) -> None:
                text = json.dumps(content).encode()
                self.send_response(code)
                self.send_header("Content-Type", "application/json")
                self.send_header("Content-Length", str(len(text)))
                self.end_headers()
                self.wfile.write(text)

            def log_message(self, *_: Any) -> None:
                return

        server = ThreadingHTTPServer(("127.0.0.1", self.port), Handler)
        server.daemon_threads = True
        thread = threading.Thread(target=server.serve_forever, daemon=True)
        thread.start()
        try:
            yield
        finally:
            server.shutdown()
            server.server_close()


def wait_for(condition: Any) -> None:
    end = threading.Event()
    for _ in range(600):
        if condition():
            return
        end.wait(0.05)
    raise AssertionError("the condition did not hold within 30 s")


def test_a_lost_mlflow_server_gets_what_it_missed(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.INFO, "test_tracking")
    server, folder = Server(), run_in(tmp_path)
    settings = TrackingSettings(mlflow=MlflowSettings(server=f"http://127.0.0.1:{server.port}"))
    trackers = Trackers(services_of(settings, folder.path.parent), LOG)
    with server.running():
        trackers.start(folder)
        trackers.add({"episode/return": 1.0}, 1)
        wait_for(lambda: server.metrics)
    trackers.add({"episode/return": 2.0}, 2)
    wait_for(lambda: "does not take metrics; the training goes on" in caplog.text)
    trackers.add({"episode/return": 3.0}, 3)
    with server.running():
        wait_for(lambda: len(server.metrics) == 3)
        trackers.close(True)
    assert server.metrics == [("episode/return", float(k), k) for k in (1, 2, 3)]
    assert server.status == "FINISHED"
    assert "MLflow replies again" in caplog.text


def test_an_absent_mlflow_server_is_said_before_anything_is_learned(tmp_path: Path) -> None:
    settings = TrackingSettings(mlflow=MlflowSettings(server="http://127.0.0.1:9"))
    trackers = Trackers(services_of(settings, tmp_path), LOG)
    with pytest.raises(
        RunError, match=r"MLflow does not reply at http://127\.0\.0\.1:9: Connection refused: start"
    ):
        trackers.start(run_in(tmp_path))
