"""Imitation learning by the workers of a real Ray cluster of two nodes, one of which is killed."""

from __future__ import annotations

import json
import logging
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from threading import Event, Thread

import numpy as np
import psutil
import pytest
from joshua.planner.pipeline import examine
from joshua.planner.request import Request
from joshua.testing.recording_context import RecordingContext
from joshua_imitation.node import ImitationTrainer
from joshua_training.run_folder import RunError
from lerobot.policies.act.modeling_act import ACTPolicy
from ray_nodes import Cluster as Nodes
from ray_nodes import add_worker, started
from safetensors.numpy import load_file, save_file
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator
from tiny_recordings import write_recording
from trainings import write_imitation


@pytest.fixture(scope="module")
def nodes() -> Iterator[Nodes]:
    found = started(1)
    add_worker(found)
    yield found
    found.shutdown()


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_recording(tmp_path_factory.mktemp("recordings") / "demos")


def cluster(nodes: Nodes) -> str:
    return f'cluster {{ address: "{nodes.address}" workers: 2 }}'


def trained(
    path: Path, meanwhile: Callable[[RecordingContext, Path], None] | None = None
) -> tuple[Path, RecordingContext]:
    """Trains in this process, and returns the folder of the run."""
    result = examine(Request(str(path)))
    assert result.plan is not None, result.errors
    context = RecordingContext(result.plan.nodes[0])
    node = ImitationTrainer(context)
    given_up = Event()

    def after_a_checkpoint() -> None:
        while not given_up.wait(0.01):
            if meanwhile is not None and list(node.folder.path.glob("checkpoints/step_*")):
                meanwhile(context, node.folder.path)
                return

    thread = Thread(target=after_a_checkpoint, daemon=True)
    try:
        node.configure()
        thread.start()
        node.activate()
        assert node._ended.wait(250)
    finally:
        given_up.set()
        try:
            context.stop(200)
        finally:
            node.cleanup()
    return node.folder.path, context


def rows(run: Path) -> list[dict[str, float]]:
    found = [json.loads(line) for line in (run / "metrics.jsonl").read_text().splitlines()]
    return [{name: value for name, value in row.items() if not name.startswith("rate/")} for row in found]


def last(run: Path) -> Path:
    return max((run / "checkpoints").glob("step_*")) / "pretrained_model"


def test_a_training_that_loses_a_node_learns_what_two_processes_learn(
    nodes: Nodes, recording: Path, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.INFO)
    (worker,) = nodes.worker_nodes
    raylet = psutil.Process(worker.all_processes["raylet"][0].process.pid)

    def kill(context: RecordingContext, run: Path) -> None:
        del context, run
        for child in raylet.children():
            with suppress(psutil.NoSuchProcess):
                if "RayTrainWorker" in child.cmdline()[0]:
                    child.kill()
        nodes.remove_node(worker, allow_graceful=False)

    for name in ("spread", "here"):
        (tmp_path / name).mkdir()
    run, context = trained(
        write_imitation(tmp_path / "spread", recording, cluster(nodes), num_epochs=12), kill
    )
    found = rows(run)
    lost = found[-1].pop("workers_lost")
    assert lost >= 1
    assert "workers lost" in context.shown
    said = caplog.text
    assert said.index(f"waiting for 2 workers of the cluster {nodes.address}") < said.index("2 workers learn")
    here, _ = trained(write_imitation(tmp_path / "here", recording, num_epochs=12, processes=2))
    expected = rows(here)
    assert [row["steps"] for row in found] == [row["steps"] for row in expected] == list(range(1, 37))
    for row, other in zip(found, expected, strict=True):
        row.pop("workers_lost", None)
        assert row == pytest.approx(other, rel=1e-4, abs=1e-6)
    board = EventAccumulator(str(run / "tensorboard"))
    board.Reload()
    assert [event.step for event in board.Scalars("loss/train")] == list(range(1, 37))
    weights = [load_file(last(folder) / "model.safetensors") for folder in (run, here)]
    for name, values in weights[0].items():
        np.testing.assert_allclose(values, weights[1][name], rtol=1e-3, atol=2e-5, err_msg=name)
    assert ACTPolicy.from_pretrained(last(run)).config.chunk_size == 8


def test_a_stopped_training_continues_on_the_cluster_until_its_loss_is_no_number(
    nodes: Nodes, recording: Path, tmp_path: Path
) -> None:
    spread = cluster(nodes)
    run, context = trained(
        write_imitation(tmp_path, recording, spread, num_epochs=100000), lambda context, _: context.stop(200)
    )
    assert context.ends == []
    steps = int(rows(run)[-1]["steps"])
    assert last(run).parent.name == f"step_{steps:012}"
    state = last(run).parent / "training.safetensors"
    arrays = load_file(state)
    arrays["optimiser.0.exp_avg"][:] = np.nan  # the weights after the next update
    save_file(arrays, state)
    path = write_imitation(tmp_path, recording, spread, num_epochs=100000, resume_run=f'"{run}"')
    said = rf"is not a number at update {steps + 2}; its batch is in .*the weights before it are kept"
    with pytest.raises(RunError, match=said):
        trained(path)
    assert [row["steps"] for row in rows(run)] == list(range(1, steps + 2))
    assert list(run.glob("failed_batch_*.safetensors"))
    path = write_imitation(tmp_path, recording, num_epochs=2, resume_run=f'"{run}"')
    with pytest.raises(RunError, match="the run was started with processes 2, but the file says 1"):
        trained(path)
