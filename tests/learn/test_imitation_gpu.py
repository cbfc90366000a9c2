"""Imitation: each process of a machine computes on a GPU of its own, with the calls of PyTorch replaced."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
import torch
from joshua_imitation import build as building
from joshua_imitation import worker
from joshua_imitation.group import Group
from joshua_imitation.node import ImitationTrainer
from learners import recording as recording
from learners import settings


class BuiltError(Exception):
    """Ends what a test is about to build."""


@pytest.fixture
def calls(monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    """Calls in their order: the number of the GPU that becomes current, or what is built."""
    found: list[Any] = []
    monkeypatch.setattr(torch.cuda, "is_available", lambda: True)
    monkeypatch.setattr(torch.cuda, "device_count", lambda: 2)
    monkeypatch.setattr(torch.cuda, "set_device", found.append)
    return found


def built(calls: list[Any]) -> Callable[..., Any]:
    def build(*arguments: Any, **options: Any) -> Any:
        calls.append("built")
        raise BuiltError

    return build


@pytest.mark.parametrize(("device", "expected"), [("cuda", [1, "built"]), ("cpu", ["built"])])
def test_a_further_process_takes_its_gpu_before_it_builds(
    recording: Path, monkeypatch: pytest.MonkeyPatch, calls: list[Any], device: str, expected: list[Any]
) -> None:
    told: dict[str, Any] = dict.fromkeys(("address", "continued", "album", "run"), "")
    told |= {"device": device, "local": 1}
    told["settings"] = settings(recording, device=device, processes=2).model_dump(mode="json")
    monkeypatch.setattr(worker, "_line", lambda: json.dumps(told).encode())
    monkeypatch.setattr(worker, "_end_with_the_other", lambda: None)
    monkeypatch.setattr(worker, "build", built(calls))
    with pytest.raises(BuiltError):
        worker.main()
    assert calls == expected


@pytest.mark.parametrize(("device", "expected"), [("cuda", [0, "built"]), ("cpu", ["built"])])
def test_the_first_process_takes_its_gpu_before_it_builds_and_learns(
    recording: Path, monkeypatch: pytest.MonkeyPatch, calls: list[Any], device: str, expected: list[Any]
) -> None:
    told = settings(recording, device=device, processes=2)
    monkeypatch.setattr(building, "open_dataset", built(calls))
    with pytest.raises(BuiltError):
        building.build(told)
    assert calls == expected
    calls.clear()
    node = SimpleNamespace(  # on the thread that learns
        _settings=told,
        _group=Group.of(told, device),
        _album=SimpleNamespace(frames=1, fill=built(calls)),
        context=None,
    )
    with pytest.raises(BuiltError):
        ImitationTrainer.prepare(node)  # type: ignore[arg-type]
    assert calls == expected
