"""Evaluations and rollouts on a real Ray cluster of two nodes, one of which is killed."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from contextlib import suppress
from functools import partial
from pathlib import Path
from threading import Event, Thread
from typing import Any

import psutil
import pytest
from evaluation_files import write_evaluation
from joshua.planner.pipeline import examine
from joshua.planner.request import Request
from joshua.testing.recording_context import RecordingContext
from joshua_evaluation.node import Evaluation
from joshua_ppo_trainer.node import PpoTrainer
from joshua_ray.cluster import Cluster
from joshua_training.run_folder import RunError
from ray_nodes import Cluster as Nodes
from ray_nodes import add_worker, started
from trained_policies import write_policy
from trainings import REACH, write_training

#: Its episodes last long enough for every node to play some.
PICK_PLACE = "joshua/SoArm100PickPlace-v0"


@pytest.fixture(scope="module")
def found_nodes() -> Iterator[Nodes]:
    found = started(1)
    yield found
    found.shutdown()


@pytest.fixture
def nodes(found_nodes: Nodes) -> Nodes:
    if not found_nodes.worker_nodes:
        add_worker(found_nodes)
    return found_nodes


def cluster(nodes: Nodes) -> str:
    return f'cluster {{ address: "{nodes.address}" workers: 2 }}'


def killing(nodes: Nodes) -> Callable[[], None]:
    (worker,) = nodes.worker_nodes
    return lambda: nodes.remove_node(worker, allow_graceful=False)


def context_of(path: Path) -> RecordingContext:
    result = examine(Request(str(path)))
    assert result.plan is not None, result.errors
    return RecordingContext(result.plan.nodes[0])


def ended(context: RecordingContext, node: Any, meanwhile: Callable[[], None] | None = None) -> None:
    node.configure()
    if meanwhile is not None:
        meanwhile()
    node.activate()
    assert node._ended.wait(200)
    context.stop()
    node.cleanup()


def evaluated(
    folder: Path, environment: str, block: str = "", meanwhile: Callable[[], None] | None = None
) -> tuple[dict[str, Any], RecordingContext]:
    """Evaluates in this process, and returns the results."""
    folder.mkdir()
    policy = write_policy(folder / "policy", environment=environment)
    path = write_evaluation(
        folder, policy, "videos: 0", episodes=30, environment=f'environment_id: "{environment}" {block}'
    )
    context = context_of(path)
    ended(context, Evaluation(context), meanwhile)
    (made,) = (folder / "runs").glob("eval-*")
    content = json.loads((made / "results.json").read_text())
    kept = ("success_rate", "avg_return", "smoothness")
    figures = {key: content["metrics"][key] for key in kept} | {"seeds": content["seeds"]}
    return figures | {"workers_lost": content.get("workers_lost")}, context


def trained(
    folder: Path, block: str = "", meanwhile: Callable[[], None] | None = None, **fields: Any
) -> list[dict[str, Any]]:
    """Trains in this process, and returns the rows of metrics."""
    folder.mkdir()
    context = context_of(write_training(folder, block, **fields))
    ended(context, PpoTrainer(context), meanwhile)
    (run,) = (folder / "runs").iterdir()
    return rows_of(run)


def rows_of(run: Path) -> list[dict[str, Any]]:
    rows = [json.loads(line) for line in (run / "metrics.jsonl").read_text().splitlines()]
    return [{name: value for name, value in row.items() if not name.startswith("rate/")} for row in rows]


def test_an_evaluation_plays_the_same_episodes_on_a_cluster_that_loses_a_node(
    nodes: Nodes, tmp_path: Path
) -> None:
    here, _ = evaluated(tmp_path / "here", PICK_PLACE)
    (worker,) = nodes.worker_nodes
    raylet = psutil.Process(worker.all_processes["raylet"][0].process.pid)
    given_up = Event()

    def kill() -> None:
        """Kills the second node while it plays an episode."""
        while not given_up.wait(0.002):
            with suppress(psutil.NoSuchProcess):
                playing = [child for child in raylet.children() if child.cmdline()[:1] == ["ray::played"]]
                if playing:
                    playing[0].kill()
                    nodes.remove_node(worker, allow_graceful=False)
                    return

    thread = Thread(target=kill)
    block = f'cluster {{ address: "{nodes.address}" }}'
    there, context = evaluated(tmp_path / "there", PICK_PLACE, block, thread.start)
    given_up.set()
    thread.join()
    lost = there["workers_lost"]
    assert lost >= 1
    assert there == here | {"workers_lost": lost}
    assert context.shown == f"success {here['success_rate']['value']:.2f}, {lost} workers lost"
    assert context.warnings == [f"workers lost: {lost}; their episodes were played again"]


def test_an_evaluation_that_loses_all_workers_keeps_the_figures_of_its_episodes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("joshua_ray.cluster.Cluster", partial(Cluster, patience_s=1.0))
    policy = write_policy(tmp_path / "policy")
    found, threads, show = started(0), list[Thread](), RecordingContext.show
    try:
        add_worker(found)
        kill = killing(found)

        def killing_show(self: RecordingContext, text: str) -> None:
            show(self, text)
            if not threads:
                threads.append(Thread(target=kill))
                threads[0].start()

        monkeypatch.setattr(RecordingContext, "show", killing_show)
        # the queue of a worker holds two episodes, so that most of them are left
        address = found.address
        block = f'environment_id: "{REACH}" cluster {{ address: "{address}" }}'
        context = context_of(
            write_evaluation(tmp_path, policy, "videos: 0", episodes=2000, environment=block)
        )
        with pytest.raises(RunError) as caught:
            ended(context, Evaluation(context))
        threads[0].join()
    finally:
        found.shutdown()
    (run,) = (tmp_path / "runs").glob("eval-*")
    content = json.loads((run / "results.json").read_text())
    played = content["episodes"]
    assert content["complete"] is False
    assert 1 <= played < 2000
    assert str(caught.value) == (
        f"all workers of the cluster {address} are lost: no node with a free core for 1 s. Start nodes "
        f"(ray start --address={address}), and run the command again. {played} of 2000 episodes were "
        f"played; their figures are in {run / 'report.html'}"
    )
    assert (run / "report.html").is_file()
    assert len((run / "episodes.csv").read_text().splitlines()) == played + 1
    assert context.ends == []


def test_ppo_gives_the_same_result_after_a_killed_node_and_after_an_interruption(
    nodes: Nodes, tmp_path: Path
) -> None:
    def last_checkpoint(name: str) -> dict[str, bytes]:
        (folder,) = (tmp_path / name).glob("runs/*/checkpoints/step_000000000480")
        files = {file.name: file.read_bytes() for file in folder.iterdir()}
        assert {"policy.safetensors", "training.safetensors", "state.json"} <= files.keys()
        return files

    first = trained(tmp_path / "first", cluster(nodes))
    assert [row["steps"] for row in first] == list(range(48, 481, 48))
    assert first[-1]["workers_lost"] == 0
    assert first[-1]["episodes"] > 0
    survived = trained(tmp_path / "survived", cluster(nodes), killing(nodes))
    assert survived[-1].pop("workers_lost") == 1
    assert survived[-1] == {name: value for name, value in first[-1].items() if name != "workers_lost"}
    assert last_checkpoint("survived") == last_checkpoint("first")
    add_worker(nodes)
    trained(tmp_path / "halves", cluster(nodes), total_timesteps=240)
    (run,) = (tmp_path / "halves/runs").iterdir()
    context = context_of(write_training(tmp_path / "halves", cluster(nodes), resume_run=f'"{run}"'))
    ended(context, PpoTrainer(context))
    assert rows_of(run) == first
    assert last_checkpoint("halves") == last_checkpoint("first")
    assert context.warnings == []
    # what the workers collected cannot be continued without them
    folder = tmp_path / "here"
    with pytest.raises(RunError, match="were in the workers of a cluster: continue with a cluster"):
        trained(folder, resume_run=f'"{run}"', total_timesteps=960)
