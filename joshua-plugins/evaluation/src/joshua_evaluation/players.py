"""Players of an evaluation: the policy of a trainer, or any model that follows the model contract."""

from __future__ import annotations

import os
from collections import deque
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from joshua.api import JointRange, JointSpace, Model, ModelError, Observation
from joshua.api.models import Execution, ModelNeeds, ModelSettings
from joshua.features import ACTION, IMAGES, STATE, Feature, FeatureSet, checked
from joshua.features.needs import unmet
from joshua.tools import load_target
from joshua_inference.strategies import STRATEGIES, Chunk, Strategy
from joshua_ppo_trainer.policy import Policy

from joshua_evaluation.checkpoints import CheckpointError
from joshua_evaluation.episodes import VIDEO_SIZE, Arena, now_s
from joshua_evaluation.plugins import ModelOffer

_NS_PER_S = 1_000_000_000

#: Libraries that compute with as many threads as the machine has cores, unless these say otherwise.
_THREADS = ("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS")


class PolicyPlayer:
    """Mean action of a policy that a trainer wrote."""

    def __init__(self, checkpoint: Path) -> None:
        self._checkpoint = checkpoint
        self._policy: Policy | None = None
        self.options: dict[str, Any] = {}

    def load(self, arena: Arena) -> None:
        """See ``Player``."""
        policy = self._policy = Policy.load(self._checkpoint)
        known, shown = policy.about["features"], arena.features
        for key, feature in known.items():
            if key not in shown or list(shown[key].shape) != list(feature["shape"]):
                has = list(shown[key].shape) if key in shown else "nothing"
                raise CheckpointError(
                    f"{self._checkpoint} expects {key} of shape {feature['shape']}, but the environment "
                    f"provides {has}",
                    "Name a checkpoint that was trained in this environment",
                )
        if len(policy.about["action_low"]) != arena.action_space.shape[0]:
            raise CheckpointError(
                f"{self._checkpoint} returns {len(policy.about['action_low'])} numbers, but the environment "
                f"expects {arena.action_space.shape[0]}",
                "Name a checkpoint that was trained in this environment",
            )

    def begin(self, seed: int) -> None:
        """See ``Player``; its actions have no noise."""

    def act(self, arena: Arena, observation: Any, step: int) -> tuple[Any, float | None]:
        """See ``Player``."""
        del step
        assert self._policy is not None
        begun_s = now_s()
        action = self._policy.act(arena.numbers(observation))[0]
        return action, now_s() - begun_s

    def close(self) -> None:
        """See ``Player``."""
        self._policy = None


class ModelPlayer:
    """A model, by the same features and strategies as in an inference, in steps instead of time.

    Args:
        offer: the plugin; task: of the model.
        strategy: name of one of ``joshua_inference``; steps_per_chunk: of it, None for its default.
        delay: steps that pass while a chunk is computed.
        noise_seed: from which and from its own each episode gets the seed of the model's random numbers.
    """

    def __init__(
        self,
        offer: ModelOffer,
        *,
        task: str = "",
        strategy: str = "SYNCHRONOUS",
        steps_per_chunk: int | None = None,
        delay: int = 0,
        noise_seed: int = 0,
    ) -> None:
        self._offer, self._task, self._delay = offer, task, delay
        self._noise_seed = noise_seed
        self._execution = Execution(strategy=strategy, steps_per_chunk=steps_per_chunk)
        self._settings = offer.made_settings()
        needs = self._settings.needs() if isinstance(self._settings, ModelSettings) else ModelNeeds()
        self._model: Model | None = None
        self._strategy: Strategy = STRATEGIES[strategy](self._execution)
        self._waiting: tuple[int, int, Any] | None = None
        self._held: Any = None
        self._features = FeatureSet()
        self._past: deque[Observation] = deque(maxlen=0)
        self._low: Any = None
        self._high: Any = None
        self.options = {"action_mode": "absolute", **_cameras(needs)}

    def load(self, arena: Arena) -> None:
        """See ``Player``. The environment must take the positions of joints, in radians."""
        action = arena.features.get(ACTION)
        if action is None or action.unit != "rad" or not action.names:
            raise CheckpointError(
                f"{self._offer.block} commands joints in radians, but the environment takes other actions",
                "Choose an environment of an arm, such as joshua/SoArm100Reach-v0",
            )
        self._low, self._high = (np.asarray(end, np.float64) for end in _ends(arena))
        joints = tuple(
            JointRange(name, float(low), float(high))
            for name, low, high in zip(action.names, self._low, self._high, strict=True)
        )
        if isinstance(self._settings, ModelSettings):
            self._settings = self._settings.model_copy(update={"rate_hz": 1 / arena.period_s})
        compute = getattr(self._settings, "compute", None)
        for variable in _THREADS:
            os.environ[variable] = str(getattr(compute, "threads", 1) or os.cpu_count())
        features = FeatureSet(
            feature for feature in (*_observed(arena), *_pictures(self.options)) if feature.key != ACTION
        )
        implementation = load_target(self._offer.implementation)
        model: Model = implementation(
            self._settings, JointSpace(action.names, self._low, self._high), features
        )
        try:
            model.load()
            needs = model.needs()
            rate_hz = 1 / arena.period_s
            lacks = unmet(needs, features, joints, rate_hz, self._execution.strategy)
            if lacks:
                raise ModelError("; ".join(f"{lack.message}. {lack.remedy}" for lack in lacks))
            if needs.reads_task and not self._task:
                raise ModelError(
                    f'{self._offer.block} does nothing without a task: add task: "…" to eval_config'
                )
        except BaseException:
            model.close()
            raise
        self._model, self._features = model, features
        self._past = deque(maxlen=needs.history - 1)

    def begin(self, seed: int) -> None:
        """See ``Player``. A model takes the seed of its random numbers from its settings when it is reset."""
        assert self._model is not None
        if isinstance(self._settings, ModelSettings):
            compute = replace(self._settings.compute, seed=noise_of(self._noise_seed, seed))
            self._model.settings = self._settings.model_copy(update={"compute": compute})
        self._model.reset()
        self._strategy.clear()
        self._past.clear()
        self._waiting = self._held = None

    def act(self, arena: Arena, observation: Any, step: int) -> tuple[Any, float | None]:
        """See ``Player``."""
        values = arena.values(observation)
        if self._held is None:
            self._held = np.asarray(values[STATE], np.float64)
        latency_s = None
        wants = self._waiting is None and self._strategy.wants(step, self._delay)
        if wants or self._past.maxlen:
            seen = self._observed(arena, values, step)
            if wants:
                began_s = now_s()
                actions = self._predict(seen, step)
                latency_s = now_s() - began_s
                self._waiting = (step + self._delay, step, actions)
            self._past.appendleft(seen)
        if self._waiting is not None and step >= self._waiting[0]:
            arrived, first, actions = self._waiting
            self._waiting = None
            late = self._strategy.on_arrival or len(actions) == 1
            stamp_ns = round(first * arena.period_s * _NS_PER_S)
            self._strategy.add(Chunk(arrived if late else first, actions, stamp_ns), step)
        due = self._strategy.due(step)
        if due is not None:
            self._held = due
        return np.clip(self._held, self._low, self._high), latency_s

    def close(self) -> None:
        """See ``Player``."""
        model, self._model = self._model, None
        if model is not None:
            model.close()

    def _observed(self, arena: Arena, values: dict[str, Any], step: int) -> Observation:
        """Return what the model sees at a step, without the steps before it."""
        seen = {
            # a copy, because an environment may render into the same memory in every step
            key: checked(feature, values[key]).copy()
            for key, feature in self._features.items()
            if key in values
        }
        stamp_ns = round(step * arena.period_s * _NS_PER_S) + 1
        return Observation(stamp_ns, seen, dict.fromkeys(seen, stamp_ns), task=self._task)

    def _predict(self, seen: Observation, step: int) -> Any:
        """Return a chunk of actions, the first of which belongs to ``step``.

        At the start of an episode, its first observation stands for those before it, as on a robot.
        """
        assert self._model is not None
        lacking = (self._past.maxlen or 0) - len(self._past)
        first = self._past[-1] if self._past else seen
        observation = replace(seen, earlier=(*self._past, *[first] * lacking))
        request = self._strategy.request(step, self._delay)
        if request is None:
            actions = self._model.act(observation)
        else:
            actions = self._model.continue_chunk(observation, request)
        actions = np.asarray(actions, np.float64)
        if not np.isfinite(actions).all():
            raise ModelError(f"{self._offer.block} returned an action that is not a number at step {step}")
        return actions


def noise_of(noise_seed: int, seed: int) -> int:
    """Return the seed of a model's random numbers in the episode of a seed, of 31 bits for any library."""
    return int(np.random.SeedSequence((noise_seed, seed)).generate_state(1)[0] >> 1)


def _ends(arena: Arena) -> tuple[Any, Any]:
    return arena.action_space.low, arena.action_space.high


def _observed(arena: Arena) -> tuple[Feature, ...]:
    return tuple(feature for feature in arena.features.values() if feature.key != ACTION)


def _cameras(needs: ModelNeeds) -> dict[str, Any]:
    """Return the options of an environment that provides what a model needs. Raises CheckpointError."""
    wanted = [feature for feature in needs.features or () if feature.is_picture]
    if not wanted:
        return {}
    sizes = {feature.shape[:2] for feature in wanted if 0 not in feature.shape[:2]}
    if len(sizes) > 1:
        raise CheckpointError(
            "The model expects pictures of several sizes "
            f"({', '.join(f'{width} × {height}' for height, width in sorted(sizes))}), but an environment "
            "renders all of them in one size",
            "Evaluate a policy whose cameras have one size",
        )
    height, width = sizes.pop() if sizes else VIDEO_SIZE[::-1]
    names = tuple(feature.key.removeprefix(IMAGES) for feature in wanted)
    return {"observation_mode": "both", "cameras": names, "width": width, "height": height}


def _pictures(options: dict[str, Any]) -> tuple[Feature, ...]:
    return tuple(
        Feature.picture(f"{IMAGES}{name}", options["height"], options["width"])
        for name in options.get("cameras", ())
    )
