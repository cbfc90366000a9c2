"""A flow policy that was trained here, and the simulated arm that it drives past a bar, in stepped time.

``tests/learn/train_reach_flow.py`` makes the demonstrations and trains the network (Lipman et al. 2023); its
weights stand beside this module. The network is computed here in numpy, with the derivative that real-time
chunking needs, so that neither tests nor pictures need PyTorch.

The grip goes from one side of the arm to a goal on the other, and passes a bar in the middle above or below.
Demonstrations do both from the same start, so that two predictions for nearly the same observation differ.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from joshua.api import FloatArray, JointSpace, Model, Observation
from joshua.api.models import ChunkRequest, Execution, ModelNeeds
from joshua.features import STATE, Feature, FeatureSet
from joshua_inference.figures import InferenceFigures
from joshua_inference.loop import InferenceLoop
from joshua_mujoco_sim.envs import make_environment
from joshua_mujoco_sim.envs.arm_terms import JOINTS, REACHED_M
from joshua_mujoco_sim.envs.kinematics import Kinematics

WEIGHTS = Path(__file__).with_suffix(".npz")
GOAL = "observation.environment_state"
RATE_HZ = 25.0
PERIOD_NS = round(1e9 / RATE_HZ)
STEPS = 32
#: A chunk is learnt as the first cosines of each joint's way, so that it is smooth.
COSINES = 8
DENOISING = 10
#: Share of a cosine that a mask must show for guidance to set it.
HARDLY = 0.03
TIME_FEATURES = 8
#: How near the bar counts as touching it, and how long the way may take.
CLEARANCE_M, LONGEST_S = 0.02, 7.0
#: A chunk is asked for as soon as the one before it is there.
OFTEN: dict[str, Any] = {"steps_per_chunk": 9, "execution_horizon": 12}


class Network:
    """The velocity of the flow: a multi-layer perceptron with SiLU, of arrays ``w0``, ``b0``, ``w1``…"""

    def __init__(self, arrays: dict[str, FloatArray]) -> None:
        count = sum(name.startswith("w") for name in arrays)
        self._layers = [(arrays[f"w{number}"], arrays[f"b{number}"]) for number in range(count)]

    def __call__(self, entry: FloatArray) -> tuple[FloatArray, Callable[[FloatArray], FloatArray]]:
        """The velocity, and the product of a row with its derivative by the entry."""
        slopes = []
        value = entry
        for weight, bias in self._layers[:-1]:
            raw = value @ weight + bias
            gate = 1 / (1 + np.exp(-raw))
            value = raw * gate
            slopes.append(gate * (1 + raw * (1 - gate)))
        last, bias = self._layers[-1]

        def back(row: FloatArray) -> FloatArray:
            row = last @ row
            for (weight, _), slope in zip(reversed(self._layers[:-1]), reversed(slopes), strict=True):
                row = weight @ (row * slope)
            return row

        return value @ last + bias, back


class ReachFlow(Model):
    """The policy: joints and the place of the goal in, chunks of the servos' goals out."""

    def __init__(self, seed: int = 0, weights: Path = WEIGHTS) -> None:
        limit = np.full(len(JOINTS), 4.0)
        super().__init__(None, JointSpace(JOINTS, -limit, limit))
        self.features = FeatureSet([Feature.joints(STATE, JOINTS), Feature(GOAL, "float32", (3,))])
        self._random = np.random.default_rng(seed)
        with np.load(weights, allow_pickle=False) as arrays:
            found = {name: arrays[name].astype(np.float64) for name in arrays.files}
        self._network = Network(found)
        self._mean, self._spread, self._scale = found["mean"], found["spread"], found["scale"]
        self._unit = float(found["unit"])

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
        """Draws a chunk that continues another one."""
        return self._denoised(observation, request)

    def _denoised(self, observation: Observation, request: ChunkRequest | None) -> FloatArray:
        """Draws a chunk by Euler's method, guided as in algorithm 1 of the paper on real-time chunking."""
        joints = np.asarray(observation[STATE], np.float64)
        seen = (np.append(joints, observation[GOAL]) - self._mean) / self._spread
        basis = self._unit * cosines().T
        noisy = self._random.normal(size=(COSINES, len(JOINTS)))
        target, mask = np.zeros((STEPS, len(JOINTS))), np.zeros((STEPS, 1))
        if request is not None:
            mask[:, 0] = request.weights(STEPS)
            length = min(len(request.planned), STEPS)
            target[:length] = (request.planned[:length] - joints) / self._scale
        # of what the mask leaves of the cosines; what it hardly shows is left to the flow
        inverse = np.linalg.inv(basis.T @ (mask * basis) + HARDLY * self._unit**2 * np.eye(COSINES))
        for number in range(DENOISING):
            at = number / DENOISING
            raw, back = self._network(np.concatenate([noisy.ravel(), seen, time_features(at)]))
            velocity = raw.reshape(noisy.shape)
            if request is not None:
                clean = noisy + (1 - at) * velocity
                error = inverse @ (basis.T @ (mask * (target - basis @ clean)))
                slope = back(error.ravel())[: error.size].reshape(error.shape)
                spread = (1 - at) ** 2 / (at**2 + (1 - at) ** 2)
                weight = min(request.max_guidance_weight, (1 - at) / (at * spread) if at else np.inf)
                velocity = velocity + weight * (error + (1 - at) * slope)
            noisy = noisy + velocity / DENOISING
        chunk: FloatArray = joints + basis @ noisy * self._scale
        return chunk


def cosines() -> FloatArray:
    """The first cosines over a chunk, orthonormal rows, shape (COSINES, STEPS)."""
    pulse = np.pi * np.arange(COSINES)[:, None] * (np.arange(STEPS) + 0.5) / STEPS
    rows: FloatArray = np.sqrt(2 / STEPS) * np.cos(pulse)
    rows[0] /= np.sqrt(2)
    return rows


def time_features(at: Any) -> FloatArray:
    """The time of the flow, from 0 to 1, as the network sees it."""
    pulses = np.pi * np.arange(1, TIME_FEATURES // 2 + 1)
    angle = np.asarray(at)[..., None] * pulses
    return np.concatenate([np.sin(angle), np.cos(angle)], axis=-1)


class Scene:
    """The arm of ``joshua/SoArm100Reach-v0`` with another start and goal, and a bar between the two.

    Attributes:
        start_m, goal_m: of the grip; bar_m: the middle of the bar, along which the arm points.
    """

    def __init__(self) -> None:
        made: Any = make_environment("joshua/SoArm100Reach-v0", action_mode="absolute")
        self.environment = made.unwrapped
        self.state = self.environment.state
        self.kinematics = Kinematics(self.state.model)
        self._sag = mujoco.MjData(self.state.model)
        self._gain = self.state.model.actuator_gainprm[: len(JOINTS), 0]

    def reset(self, seed: int) -> None:
        """Begins an episode: start and goal on different sides, and the arm at rest at the start."""
        self.environment.reset(seed=seed)
        draw = np.random.default_rng(seed)
        side = draw.choice((-1.0, 1.0))
        self.start_m, self.goal_m = (
            _place(sign * side * draw.uniform(0.55, 0.7), draw.uniform(0.22, 0.26), draw.uniform(0.11, 0.13))
            for sign in (-1, 1)
        )
        self.bar_m = (self.start_m + self.goal_m) / 2
        state = self.state
        joints = np.array(state.qpos[0, :6])
        for _ in range(10):
            joints[:5] = self.kinematics.solve(joints[:5], self.start_m)
        state.qpos[0, :6], state.qvel[0, :6] = joints, 0.0
        state.ctrl[0] = self.held(joints)
        state.mocap_pos[0, 0] = self.goal_m
        mujoco.mj_forward(state.model, state.data)

    def held(self, joints: FloatArray) -> FloatArray:
        """Goals of the servos that hold the arm there against gravity."""
        self._sag.qpos[:6], self._sag.qvel[:] = joints, 0.0
        mujoco.mj_forward(self.state.model, self._sag)
        held: FloatArray = joints + self._sag.qfrc_bias[:6] / self._gain
        return held

    @property
    def joints(self) -> FloatArray:
        """Where the joints are, rad."""
        return np.array(self.state.qpos[0, :6])

    @property
    def grip_m(self) -> FloatArray:
        """Where the grip is."""
        return np.array(self.state.site("gripper")[0])

    def move(self, goals: FloatArray) -> None:
        """One period of the arm."""
        self.environment.step(goals.astype(np.float32))

    @property
    def reached(self) -> bool:
        """Whether the grip is at the goal, by the rule of the environment."""
        return bool(np.linalg.norm(self.grip_m - self.goal_m) < REACHED_M)


def _place(angle_rad: float, radius_m: float, height_m: float) -> FloatArray:
    return np.array([radius_m * np.sin(angle_rad), -0.045 - radius_m * np.cos(angle_rad), height_m])


@dataclass(frozen=True)
class Run:
    """One way past the bar.

    Attributes:
        commands: shape (T, 6), rad; path: of the grip relative to the bar, shape (T, 3), m.
        borders: periods in which another chunk began to play.
        reached: the goal, by the rule of the environment; clear: of the bar.
    """

    commands: FloatArray
    path: FloatArray
    borders: tuple[int, ...]
    figures: InferenceFigures
    reached: bool
    clear: bool

    @property
    def passed(self) -> bool:
        """Past the bar and at the goal."""
        return self.reached and self.clear

    @property
    def time_s(self) -> float:
        """How long it took."""
        return len(self.commands) / RATE_HZ


class _Delayed(Model):
    """Answers after some periods, in which the arm goes on."""

    def __init__(self, policy: Model, wait: Callable[[], None]) -> None:
        super().__init__(None, policy.joints)
        self._policy, self._wait = policy, wait

    load = reset = close = lambda self: None

    def act(self, observation: Observation) -> FloatArray:
        chunk = self._policy.act(observation)
        self._wait()
        return chunk

    def continue_chunk(self, observation: Observation, request: ChunkRequest) -> FloatArray:
        chunk = self._policy.continue_chunk(observation, request)
        self._wait()
        return chunk


def drive(
    strategy: str,
    *,
    delay_s: float = 0.3,
    seed: int = 0,
    scene: Scene | None = None,
    policy: Model | None = None,
    **execution: Any,
) -> Run:
    """Lets the policy drive the arm once, by the real loop in stepped time; chunks come ``delay_s`` late."""
    scene = scene or Scene()
    scene.reset(seed)
    policy = policy or ReachFlow(seed)
    clock_ns = 1_000_000_000
    commands: list[FloatArray] = []
    path: list[FloatArray] = []
    borders: list[int] = []
    chosen = replace(Execution(strategy=strategy), **(OFTEN | execution))
    loop = InferenceLoop(chosen, policy.joints, 1 / RATE_HZ, lambda: clock_ns)

    def period() -> None:
        nonlocal clock_ns
        before = loop.figures().borders
        action = loop.tick(runs=True, keep=True)
        if loop.figures().borders > before:
            borders.append(len(commands))
        goals = np.array(scene.state.ctrl[0]) if action is None else action
        commands.append(goals)
        scene.move(goals)
        path.append(scene.grip_m - scene.bar_m)
        clock_ns += PERIOD_NS

    def wait() -> None:
        arrival_ns = clock_ns + round(delay_s * 1e9)
        while clock_ns < arrival_ns:
            period()

    model = _Delayed(policy, wait)
    reached = False
    while len(commands) < LONGEST_S * RATE_HZ and not reached:
        if loop.wait(0.0):
            values = {STATE: scene.joints, GOAL: scene.goal_m}
            loop.predict(model, Observation(clock_ns, values))
        else:
            period()
        reached = scene.reached
    ways = np.array(path)
    near = np.abs(ways[:, 0]) < 0.03
    clear = bool(near.any() and np.abs(ways[near, 2]).min() > CLEARANCE_M)
    return Run(np.array(commands), ways, tuple(borders), loop.figures(), reached, clear)
