"""A flow policy in numpy, and an arm that it drives past an obstacle, in stepped time.

The policy is the flow that matches its demonstrations exactly (Lipman et al. 2023): they are normally
distributed about a way on either side of the obstacle, so that the velocity that flow matching learns has a
closed form, and so has the derivative that real-time chunking needs. Two predictions for nearly the same
observation differ, as those of a trained policy do.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from joshua.api import FloatArray, JointSpace, Model, Observation
from joshua.api.models import ChunkRequest, Execution, ModelNeeds
from joshua.features import STATE, Feature, FeatureSet
from joshua_inference.figures import InferenceFigures
from joshua_inference.loop import InferenceLoop

RATE_HZ = 30.0
PERIOD_NS = round(1e9 / RATE_HZ)
STEPS = 40
DENOISING = 10
#: The way takes four seconds; the obstacle stands in its middle.
WAY_S = 4.0
SIDES_RAD = np.array([-0.45, 0.45])
#: How well the sides are told apart by where the arm is, and how much demonstrations of one side differ.
NEARNESS_RAD = 0.12
WIGGLE_RAD = 0.06
CLEARANCE_RAD = 0.2
#: Actions are learnt in this unit.
SCALE_RAD = 0.3
#: Time constant of the arm.
LAG_S = 0.06


class FlowPolicy(Model):
    """Pan goes from 0 to 1 rad, lift passes the obstacle above or below."""

    def __init__(self, seed: int = 0) -> None:
        names = ("pan", "lift")
        super().__init__(None, JointSpace(names, np.full(2, -2.0), np.full(2, 2.0)))
        self.features = FeatureSet([Feature.joints(STATE, names)])
        self._random = np.random.default_rng(seed)

    def load(self) -> None:
        """Nothing to load."""

    def reset(self) -> None:
        """Nothing to forget."""

    def close(self) -> None:
        """Nothing to free."""

    def needs(self) -> ModelNeeds:
        """It can continue a chunk."""
        return ModelNeeds(supports_rtc=True, chunk_steps=STEPS)

    def act(self, observation: Observation) -> FloatArray:
        """Draws a chunk."""
        return self._denoised(observation, None)

    def continue_chunk(self, observation: Observation, request: ChunkRequest) -> FloatArray:
        """Draws a chunk that continues another one: guidance by the paper's pseudo-inverse, algorithm 1."""
        return self._denoised(observation, request)

    def _denoised(self, observation: Observation, request: ChunkRequest | None) -> FloatArray:
        """Draws a chunk by Euler's method, guided as in algorithm 1 of the paper on real-time chunking."""
        means, prior = demonstrated(observation[STATE])
        noisy = self._random.normal(size=2 * STEPS)
        target, mask = np.zeros((STEPS, 2)), np.zeros((STEPS, 2))
        if request is not None:
            mask[:] = request.weights(STEPS)[:, None]
            length = min(len(request.planned), STEPS)
            target[:length] = request.planned[:length] / SCALE_RAD
        for number in range(DENOISING):
            at = number / DENOISING
            clean, slope = self._predicted(noisy, means, prior, at)
            velocity = (clean - noisy) / (1 - at)
            if request is not None:
                pull = slope((target.ravel() - clean) * mask.ravel())
                spread = (1 - at) ** 2 / (at**2 + (1 - at) ** 2)
                weight = min(request.max_guidance_weight, (1 - at) / (at * spread) if at else np.inf)
                velocity = velocity + weight * pull
            noisy = noisy + velocity / DENOISING
        return noisy.reshape(STEPS, 2) * SCALE_RAD

    def _predicted(
        self, noisy: FloatArray, means: FloatArray, prior: FloatArray, at: float
    ) -> tuple[FloatArray, Callable[[FloatArray], FloatArray]]:
        """The mean of the chunks behind a noisy one, and the product of a row with its derivative."""
        variance = at**2 * _VARIANCES + (1 - at) ** 2  # along the axes of the demonstrations
        gain = at * _VARIANCES / variance
        off = (noisy - at * means) @ _AXES
        scores = -(off / variance) @ _AXES.T
        logs = np.log(prior) - 0.5 * (off**2 / variance).sum(axis=1)
        shares = np.exp(logs - logs.max())
        shares /= shares.sum()
        each = means + (off * gain) @ _AXES.T
        mean_score = shares @ scores

        def slope(row: FloatArray) -> FloatArray:
            within = _AXES @ (gain * (_AXES.T @ row))
            between: FloatArray = (shares * (each @ row)) @ (scores - mean_score)
            return within + between

        return shares @ each, slope


def demonstrated(state: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The middle of the demonstrations on either side, scaled, and how likely each side is there."""
    pan, lift = state
    pans = np.minimum(1.0, pan + _TIMES_S / WAY_S)
    offsets = lift - SIDES_RAD * np.sin(np.pi * np.clip(pan, 0, 1))
    lifts = SIDES_RAD[:, None] * np.sin(np.pi * pans) + offsets[:, None] * np.exp(-_TIMES_S / 0.5)
    chunks = np.stack([np.broadcast_to(pans, lifts.shape), lifts], axis=-1).reshape(len(SIDES_RAD), -1)
    likely = np.exp(-0.5 * (offsets / NEARNESS_RAD) ** 2) + 1e-9
    return chunks / SCALE_RAD, likely / likely.sum()


_TIMES_S = np.arange(STEPS) / RATE_HZ


def _variation() -> tuple[FloatArray, FloatArray]:
    """Variances and axes of what demonstrations differ in: they leave the present state by and by."""
    growth = WIGGLE_RAD / SCALE_RAD * (1 - np.exp(-_TIMES_S / 0.15))
    near = np.exp(-0.5 * ((_TIMES_S[:, None] - _TIMES_S) / 0.25) ** 2)
    one = near * growth[:, None] * growth + 1e-4 * np.eye(STEPS)
    variances, axes = np.linalg.eigh(np.kron(one, np.eye(2)))
    return variances, axes


_VARIANCES, _AXES = _variation()


@dataclass(frozen=True)
class Run:
    """One way past the obstacle: what was commanded, where the arm was, and whether it passed."""

    commands: FloatArray
    positions: FloatArray
    borders: tuple[int, ...]
    figures: InferenceFigures
    passed: bool


class _Delayed(Model):
    """Answers after some periods, in which the arm goes on."""

    def __init__(self, policy: FlowPolicy, wait: object) -> None:
        super().__init__(None, policy.joints)
        self._policy, self._wait = policy, wait

    load = reset = close = lambda self: None

    def act(self, observation: Observation) -> FloatArray:
        chunk = self._policy.act(observation)
        self._wait()  # type: ignore[operator]
        return chunk

    def continue_chunk(self, observation: Observation, request: ChunkRequest) -> FloatArray:
        chunk = self._policy.continue_chunk(observation, request)
        self._wait()  # type: ignore[operator]
        return chunk


def drive(strategy: str, *, delay_s: float = 0.3, seed: int = 0, **execution: object) -> Run:
    """Lets the policy drive the arm once, by the real loop in stepped time."""
    clock_ns = 1_000_000_000
    position = np.random.default_rng(seed).normal(scale=0.02, size=2)
    commands: list[FloatArray] = []
    positions: deque[FloatArray] = deque()
    borders: list[int] = []
    policy = FlowPolicy(seed)
    chosen = replace(Execution(strategy=strategy), **execution)  # type: ignore[arg-type]
    loop = InferenceLoop(chosen, policy.joints, 1 / RATE_HZ, lambda: clock_ns)

    def period() -> None:
        nonlocal clock_ns, position
        before = loop.figures().borders
        action = loop.tick(runs=True, keep=True)
        if loop.figures().borders > before:
            borders.append(len(commands))
        if action is not None:
            position = position + (action - position) * (1 - np.exp(-1 / RATE_HZ / LAG_S))
        commands.append(position.copy() if action is None else action)
        positions.append(position.copy())
        clock_ns += PERIOD_NS

    def wait() -> None:
        for _ in range(round(delay_s * RATE_HZ)):
            period()

    model = _Delayed(policy, wait)
    while len(commands) < (WAY_S + 1.5) * RATE_HZ:
        if loop.wait(0.0):
            loop.predict(model, Observation(clock_ns, {STATE: position.copy()}))
        else:
            period()
    path = np.array(positions)
    near = np.abs(path[:, 0] - 0.5) < 0.1
    passed = bool(near.any() and np.abs(path[near, 1]).min() > CLEARANCE_RAD and path[-1, 0] > 0.9)
    return Run(np.array(commands), path, tuple(borders), loop.figures(), passed)
