"""The conformance check of models."""

from __future__ import annotations

import copy
import time
from collections.abc import Callable, Collection
from typing import Any

import numpy as np

from joshua.models.model import Model, ModelError, Observation
from joshua.testing import resources
from joshua.testing.conformance import Checklist, ViolationError, name_of, refuses, require
from joshua.testing.lifecycle import require_verbs

ModelFactory = Callable[[], Model]


def check_model(
    factory: ModelFactory,
    *,
    observe: Callable[[], Observation] | None = None,
    only: Collection[str] = (),
) -> None:
    """Checks a model against the contract of ``joshua.models.model.Model``.

    Args:
        factory: makes a model that is not loaded; each call a new one.
        observe: makes an observation that the model can act on; without it, one without values.
        only: names of the clauses to check, such as ``("limits",)`` while one is mended; empty for all.

    Raises:
        ConformanceError: lists every violated clause: what was observed, why it is wrong, the likely cause.
    """
    clauses = _ModelClauses(factory, observe or (lambda: Observation(time.time_ns())))
    checklist = Checklist(name_of(factory, lambda model: model.close()), only)
    checklist.run("constructor", clauses.constructor)
    checklist.run("order", clauses.order)
    if checklist.run("load", clauses.load):
        if checklist.run("actions", clauses.actions):
            checklist.run("limits", clauses.limits)
            checklist.run("own data", clauses.own_data)
            checklist.run("reset", clauses.reset)
        checklist.run("close", clauses.close)
        checklist.run("nothing left", clauses.nothing_left)
        checklist.run("instances", clauses.instances)
    checklist.finish()


class _ModelClauses:
    """One method for each clause; each makes its own model."""

    def __init__(self, factory: ModelFactory, observe: Callable[[], Observation]) -> None:
        self._factory = factory
        self._observe = observe

    def _loaded(self) -> Model:
        model = self._factory()
        model.load()
        model.reset()
        return model

    def constructor(self) -> None:
        """The constructor does no I/O and makes a Model."""
        before = resources.take()
        model = self._factory()
        opened = resources.take().since(before)
        require(
            isinstance(model, Model),
            f"the factory made {type(model).__name__}",
            why="the inference node drives a Model",
            cause="the class does not derive from joshua.models.model.Model",
        )
        require(
            not opened,
            f"the constructor opened {opened}",
            why="a file is planned with the object made; weights are loaded in the node's own process",
            cause="work that belongs into load stands in __init__",
        )
        require_verbs(model)

    def order(self) -> None:
        """Act is refused before load and after close."""
        model = self._factory()
        why = "a call in the wrong order is a fault of the program, which must be told from one of the model"
        cause = "act does not look whether the model is loaded"
        refuses(lambda: model.act(self._observe()), ModelError, "act before load", why=why, cause=cause)
        model.load()
        model.reset()
        model.close()
        refuses(lambda: model.act(self._observe()), ModelError, "act after close", why=why, cause=cause)

    def load(self) -> None:
        """The model loads."""
        self._loaded().close()

    def actions(self) -> None:
        """Act returns a finite float64 array of shape (T, N), T ≥ 1."""
        model = self._loaded()
        try:
            count = len(model.joints.names)
            actions: Any = model.act(self._observe())
            require(
                isinstance(actions, np.ndarray) and actions.dtype == np.float64,
                f"act returned {type(actions).__name__}"
                + (f" of {actions.dtype}" if isinstance(actions, np.ndarray) else ""),
                why="actions are radians in float64, free of the model's library",
                cause="a tensor or an array of another type is handed out",
            )
            require(
                actions.ndim == 2 and actions.shape[0] >= 1 and actions.shape[1] == count,
                f"act returned shape {actions.shape}; {count} joints need (T, {count}), T ≥ 1",
                why="the node plays one row for each period of the publisher",
                cause="a single action without the dimension of time, or one with a batch",
            )
            require(
                bool(np.isfinite(actions).all()),
                "act returned a value that is not finite",
                why="the node refuses such actions and fails",
                cause="a normalisation with a deviation of zero, or weights that did not converge",
            )
        finally:
            model.close()

    def limits(self) -> None:
        """Actions lie within the limits of the joints."""
        model = self._loaded()
        try:
            joints = model.joints
            for _ in range(20):
                actions = model.act(self._observe())
                over = np.maximum(actions - joints.position_max_rad, joints.position_min_rad - actions).max()
                require(
                    over <= 1e-6,
                    f"an action lies {over:.3f} rad beyond a joint's limits",
                    why="actions are positions in radians that the joints can reach",
                    cause="actions are not turned back from the model's normalised range, or not clipped",
                )
        finally:
            model.close()

    def own_data(self) -> None:
        """Actions and observations are not changed afterwards."""
        model = self._loaded()
        try:
            observation = self._observe()
            shown = copy.deepcopy(dict(observation.values))
            first = model.act(observation)
            kept = first.copy()
            require(
                _same(dict(observation.values), shown),
                "act changed the observation",
                why="other parts of the node use the same messages",
                cause="the preprocessing works in place",
            )
            model.act(self._observe())
            require(
                bool((first == kept).all()),
                "the next act changed the actions that were returned before",
                why="a chunk plays while the model works on the next one",
                cause="one buffer is used for all actions",
            )
        finally:
            model.close()

    def reset(self) -> None:
        """Reset works between two episodes."""
        model = self._loaded()
        try:
            for _ in range(2):
                model.act(self._observe())
                model.reset()
            model.act(self._observe())
        finally:
            model.close()

    def close(self) -> None:
        """Close works in every state, and twice."""
        states: dict[str, Callable[[Model], object]] = {
            "never loaded": lambda model: None,
            "loaded": lambda model: model.load(),
            "used": lambda model: (model.load(), model.reset(), model.act(self._observe())),
        }
        for state, reach in states.items():
            model = self._factory()
            reach(model)
            try:
                model.close()
                model.close()
            except Exception as error:
                raise ViolationError(
                    f"close raised {type(error).__name__}: {error} ({state})",
                    "the stop of a run closes every model, in whatever state a fault left it",
                    "close uses something that load has not made, or frees it twice",
                ) from error

    def nothing_left(self) -> None:
        """After close no thread and no file handle is left."""
        self._use()  # what a first use loads once and for all is not a leak
        before = resources.take()
        self._use()
        left = resources.left_since(before)
        require(
            not left,
            f"close left {left}",
            why="a node that restarts would run out of handles and memory",
            cause="a file of weights is not closed, or a worker is not told to end and joined",
        )

    def instances(self) -> None:
        """Two models share nothing."""
        why = "a run may hold two models of the same kind in one process"
        cause = "state stands on the class or in the module in place of the instance"
        first, second = self._factory(), self._factory()
        require(first is not second, "the factory made the same object twice", why=why, cause=cause)
        try:
            first.load()
            first.reset()
            refuses(
                lambda: second.act(self._observe()),
                ModelError,
                "act of one while only the other is loaded",
                why=why,
                cause=cause,
            )
            second.load()
            second.close()
            try:
                first.act(self._observe())
            except Exception as error:
                raise ViolationError(
                    f"closing one broke the other: {type(error).__name__}: {error}", why, cause
                ) from error
        finally:
            first.close()
            second.close()

    def _use(self) -> None:
        model = self._loaded()
        model.act(self._observe())
        model.close()


def _same(first: dict[str, Any], second: dict[str, Any]) -> bool:
    return first.keys() == second.keys() and all(np.array_equal(first[key], second[key]) for key in second)
