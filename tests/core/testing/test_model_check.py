from __future__ import annotations

import os
import threading
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from joshua.models.model import JointSpace, Model, ModelError, Observation
from joshua.schema import config_pb2
from joshua.testing import ConformanceError, check_model
from joshua_inference.random_noise import RandomNoise
from joshua_inference.random_noise_settings import RandomNoiseSettings

JOINTS = JointSpace(("a", "b"), np.array([-1.0, -0.1]), np.array([1.0, 0.1]))
SETTINGS = RandomNoiseSettings.from_block(config_pb2.RandomNoiseConfig())


def observe() -> Observation:
    return Observation(1, {"observation.state": np.array([7.0, 8.0])})


def test_random_noise_conforms() -> None:
    check_model(lambda: RandomNoise(SETTINGS, JOINTS))
    check_model(lambda: RandomNoise(SETTINGS, JOINTS), observe=observe)


class OpensInConstructor(RandomNoise):
    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        opened_handles.append(os.open(os.devnull, os.O_RDONLY))


class ActsWithoutWeights(RandomNoise):
    def act(self, observation: Observation) -> Any:
        return np.zeros((1, 2))


class CannotLoad(RandomNoise):
    def load(self) -> None:
        raise ModelError("no weights at checkpoints/policy")


class Acts(RandomNoise):
    change: Callable[[Any], Any]

    def act(self, observation: Observation) -> Any:
        return type(self).change(super().act(observation))


def acts(change: Callable[[Any], Any]) -> type[Acts]:
    return type("Acts", (Acts,), {"change": staticmethod(change)})


class ChangesTheObservation(RandomNoise):
    def act(self, observation: Observation) -> Any:
        for value in observation.values.values():
            value -= 7
        return super().act(observation)


class OneBuffer(RandomNoise):
    buffer = None

    def act(self, observation: Observation) -> Any:
        actions = super().act(observation)
        if self.buffer is None:
            self.buffer = np.empty_like(actions)
        self.buffer[:] = actions
        return self.buffer


class ResetsOnce(RandomNoise):
    resets = 0

    def reset(self) -> None:
        self.resets += 1
        if self.resets > 2:
            raise RuntimeError("the episode has ended")
        super().reset()


class ClosesOnce(RandomNoise):
    def close(self) -> None:
        del self._generator


class LeavesAThread(RandomNoise):
    def load(self) -> None:
        super().load()
        threading.Thread(target=leaked_thread_end.wait, name="worker", daemon=True).start()


class SharesItsWeights(RandomNoise):
    weights: list[Any] = []  # noqa: RUF012 (the fault that is to be found)

    def load(self) -> None:
        super().load()
        self.weights.append(1)

    def act(self, observation: Observation) -> Any:
        if not self.weights:
            raise ModelError("not loaded")
        return super().act(observation)

    def close(self) -> None:
        super().close()
        self.weights.clear()


opened_handles: list[int] = []
leaked_thread_end = threading.Event()

BROKEN: list[tuple[type[Model], str, str]] = [
    (OpensInConstructor, "constructor", "the constructor opened 1 file handle (/dev/null)"),
    (ActsWithoutWeights, "order", "act before load returned array("),
    (CannotLoad, "load", "ModelError: no weights at checkpoints/policy"),
    (acts(lambda a: a.tolist()), "actions", "act returned list"),
    (acts(lambda a: a.astype(np.float32)), "actions", "act returned ndarray of float32"),
    (acts(lambda a: a[0]), "actions", "act returned shape (2,); 2 joints need (T, 2), T ≥ 1"),
    (acts(lambda a: a[:0]), "actions", "act returned shape (0, 2)"),
    (acts(lambda a: a * np.nan), "actions", "act returned a value that is not finite"),
    (acts(lambda a: a + 2048), "limits", "rad beyond a joint's limits"),
    (ChangesTheObservation, "own data", "act changed the observation"),
    (OneBuffer, "own data", "the next act changed the actions that were returned before"),
    (ResetsOnce, "reset", "RuntimeError: the episode has ended"),
    (ClosesOnce, "close", "close raised AttributeError"),
    (LeavesAThread, "nothing left", "close left 2 threads (worker, worker)"),
    (SharesItsWeights, "instances", "closing one broke the other: ModelError: not loaded"),
]


@pytest.mark.parametrize(("broken", "clause", "observed"), BROKEN)
def test_each_violated_clause_is_found(broken: type[Any], clause: str, observed: str) -> None:
    try:
        with pytest.raises(ConformanceError) as caught:
            check_model(lambda: broken(SETTINGS, JOINTS), observe=observe, only=(clause,))
    finally:
        leaked_thread_end.set()
        leaked_thread_end.clear()
        while opened_handles:
            os.close(opened_handles.pop())
    (violation,) = caught.value.violations
    assert violation.clause == clause
    assert observed in violation.observed, str(caught.value)
    assert violation.why
    assert violation.cause


def test_a_factory_that_makes_the_same_model_twice_is_found() -> None:
    model = RandomNoise(SETTINGS, JOINTS)
    with pytest.raises(ConformanceError, match="the factory made the same object twice"):
        check_model(lambda: model, only=("instances",))


def test_a_model_that_does_not_load_gives_no_flood() -> None:
    with pytest.raises(ConformanceError) as caught:
        check_model(lambda: CannotLoad(SETTINGS, JOINTS))
    assert [violation.clause for violation in caught.value.violations] == ["order", "load"]


def test_every_clause_has_a_model_that_breaks_it() -> None:
    with pytest.raises(ValueError, match="no clause is named rate; clauses: constructor, ") as refused:
        check_model(lambda: RandomNoise(SETTINGS, JOINTS), only=("rate",))
    clauses = str(refused.value).split("clauses: ")[1].split(", ")
    assert set(clauses) == {clause for _, clause, _ in BROKEN}
