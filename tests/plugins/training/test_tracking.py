"""Rows of metrics reach a service in order, and a lost service costs rows there, never the training."""

from __future__ import annotations

import json
import logging
import threading
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest
from joshua_training import tracking
from joshua_training.run_folder import RunFolder
from joshua_training.tracking import IDENTITIES, Row, Service, Trackers, facts_of

LOG = logging.getLogger("test_tracking")


class Recorder(Service):
    """A service that can be lost."""

    NAME = "Recorder"

    def __init__(self, lost: bool = False) -> None:
        self.lost = lost
        self.rows: list[tuple[int, Row]] = []
        self.tried, self.got = threading.Event(), threading.Event()
        self.ends: list[bool] = []
        self.continued = ""

    def start(self, folder: RunFolder, identity: str) -> str:
        self.continued = identity
        return identity or "run-1"

    def send(self, rows: Sequence[tuple[int, Row]]) -> None:
        self.tried.set()
        if self.lost:
            raise ConnectionError("connection refused")
        self.rows += rows
        self.got.set()

    def finish(self, succeeded: bool) -> None:
        if self.lost:
            raise ConnectionError("connection refused")
        self.ends.append(succeeded)


def folder_in(path: Path) -> RunFolder:
    facts: dict[str, Any] = {
        "seed": 3,
        "settings": {"gamma": 0.9, "activation": "tanh"},
        "git": {"commit": "abc", "changed": False},
    }
    return RunFolder.create(path, "run", facts)


@pytest.fixture(autouse=True)
def short_waits(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tracking, "RETRY_S", 0.02)
    monkeypatch.setattr(tracking, "CLOSE_S", 0.5)


def test_rows_arrive_in_order_and_only_those_of_a_group(tmp_path: Path, caplog: Any) -> None:
    service = Recorder()
    trackers = Trackers([service], LOG)
    trackers.start(folder_in(tmp_path))
    for step in range(300):
        trackers.add({"steps": step, "loss/train": step / 2, "loss/wrong": float("nan")}, step)
    trackers.add({"steps": 300}, 300)
    trackers.close(True)
    assert [(steps, dict(row)) for steps, row in service.rows] == [
        (step, {"loss/train": step / 2}) for step in range(300)
    ]
    assert service.ends == [True]
    assert not caplog.records


def test_a_lost_service_is_named_once_and_gets_its_rows_when_it_is_back(tmp_path: Path, caplog: Any) -> None:
    caplog.set_level(logging.INFO)
    service = Recorder(lost=True)
    trackers = Trackers([service], LOG)
    trackers.start(folder_in(tmp_path))
    trackers.add({"loss/train": 1.0}, 1)
    assert service.tried.wait(5)
    trackers.add({"loss/train": 2.0}, 2)
    service.lost = False
    assert service.got.wait(5)
    trackers.close(False)
    assert [steps for steps, _ in service.rows] == [1, 2]
    assert service.ends == [False]
    said = [record.getMessage() for record in caplog.records]
    assert said.count("Recorder does not take metrics; the training goes on: connection refused") == 1
    assert "Recorder replies again" in said


def test_a_service_that_stays_lost_does_not_delay_the_end(tmp_path: Path, caplog: Any) -> None:
    service = Recorder(lost=True)
    trackers = Trackers([service], LOG)
    trackers.start(folder_in(tmp_path))
    for step in range(5):
        trackers.add({"loss/train": 1.0}, step)
    trackers.close(True)
    trackers.close(True)
    assert caplog.records[-1].getMessage() == (
        "Recorder did not get 5 rows of metrics; metrics.jsonl has all of them"
    )


def test_a_full_box_drops_its_oldest_rows_and_counts_them(
    tmp_path: Path, caplog: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tracking, "KEPT_ROWS", 3)
    service = Recorder(lost=True)
    trackers = Trackers([service], LOG)
    trackers.start(folder_in(tmp_path))
    for step in range(7):
        trackers.add({"loss/train": 1.0}, step)
    trackers.close(True)
    assert "did not get 7 rows" in caplog.records[-1].getMessage()


def test_a_continued_run_continues_its_record(tmp_path: Path) -> None:
    folder = folder_in(tmp_path)
    trackers = Trackers([Recorder()], LOG)
    trackers.start(folder)
    trackers.close(True)
    assert json.loads((folder.path / IDENTITIES).read_text()) == {"Recorder": "run-1"}
    again = Recorder()
    trackers = Trackers([again], LOG)
    trackers.start(folder)
    trackers.close(True)
    assert again.continued == "run-1"


def test_a_row_that_is_computed_again_is_not_sent_again(tmp_path: Path) -> None:
    service = Recorder()
    service.sent, service.sent_names = 2, frozenset({"loss/train"})
    trackers = Trackers([service], LOG)
    trackers.start(folder_in(tmp_path))
    for step in (1, 2, 3, 4, 3, 4, 5):
        trackers.add({"loss/train": 1.0}, step)
    trackers.close(True)
    assert [steps for steps, _ in service.rows] == [3, 4, 5]


def test_further_figures_of_the_newest_row_are_sent(tmp_path: Path) -> None:
    """A run that was stopped during a round on the robot owes it when it continues."""
    service = Recorder()
    service.sent, service.sent_names = 2, frozenset({"loss/train"})
    trackers = Trackers([service], LOG)
    trackers.start(folder_in(tmp_path))
    trackers.add({"loss/train": 1.0, "robot/success_rate": 0.5}, 2)
    trackers.add({"robot/success_rate": 0.5}, 2)
    trackers.add({"loss/train": 0.5}, 3)
    trackers.close(True)
    assert service.rows == [(2, {"robot/success_rate": 0.5}), (3, {"loss/train": 0.5})]


def test_facts_are_flat_texts(tmp_path: Path) -> None:
    facts = facts_of(folder_in(tmp_path))
    assert {"seed": "3", "gamma": "0.9", "activation": "tanh", "git.commit": "abc"}.items() <= facts.items()
