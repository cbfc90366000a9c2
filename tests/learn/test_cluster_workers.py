"""What a worker of a cluster says that cannot learn, here without a cluster."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from joshua_imitation.settings import ImitationSettings
from joshua_imitation.spread import SpreadLearner, learn
from joshua_jobs.executor import Joint, Post
from joshua_jobs.processes import Processes
from joshua_training.run_folder import RunError, RunFolder


class Box(Post):
    """Keeps what is told."""

    stopping = False

    def __init__(self) -> None:
        self.told: list[Any] = []

    def tell(self, value: Any) -> None:
        self.told.append(value)


@pytest.fixture(autouse=True)
def alone(monkeypatch: pytest.MonkeyPatch) -> None:
    """The variables by which Ray Train describes the only worker."""
    for name, value in {"RANK": 0, "LOCAL_RANK": 0, "WORLD_SIZE": 1, "LOCAL_WORLD_SIZE": 1}.items():
        monkeypatch.setenv(name, str(value))
    monkeypatch.setenv("MASTER_ADDR", "127.0.0.1")
    monkeypatch.setenv("MASTER_PORT", "1")


def told(run: Path, dataset: Path) -> dict[str, Any]:
    settings = ImitationSettings(dataset=str(dataset), device="cpu", threads=1)
    return {"settings": settings.model_dump(mode="json"), "run": str(run), "name": f"test-{os.getpid()}"}


def test_a_node_that_does_not_see_the_run_is_named(tmp_path: Path) -> None:
    run = tmp_path / "runs" / "act-1"
    with pytest.raises(RunError) as caught:
        learn(told(run, tmp_path / "demos"), Box())
    assert str(caught.value) == (
        f"on the node {os.uname().nodename}, {run} does not exist: give the folder of the runs the same path "
        "on every machine, for example on a network file system"
    )


def test_a_node_that_does_not_see_the_data_set_is_named(tmp_path: Path) -> None:
    folder = RunFolder.create(tmp_path, "act", {})
    with pytest.raises(RunError) as caught:
        learn(told(folder.path, tmp_path / "demos"), Box())
    assert str(caught.value) == (
        f"on the node {os.uname().nodename}, {tmp_path / 'demos'} does not exist: correct dataset_name, or "
        "give the data set the same path on every machine, for example on a network file system"
    )


class Workers(Processes):
    """Workers that begin again after the second update, from a checkpoint after the first."""

    def together(self, work: Joint[Any]) -> Iterator[Any]:
        """Tell what they do."""
        del work
        for steps, news in ((1, {"after": 0}), (2, {}), (2, {"after": 1}), (3, {})):
            yield {"steps": steps, "row": {"steps": steps, "loss/train": 1.0}, **news}


def test_rows_after_the_checkpoint_of_workers_that_begin_again_are_forgotten(tmp_path: Path) -> None:
    rewound: list[int] = []
    settings = ImitationSettings(dataset=str(tmp_path), device="cpu", cluster="local", cluster_workers=1)
    learner = SpreadLearner(Workers(1), settings, RunFolder(tmp_path), 0, 9, rewound.append)
    assert [(learner.update() or {})["steps"] for _ in range(4)] == [1, 2, 2, 3]
    assert rewound == [1]
