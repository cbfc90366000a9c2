"""A trained policy on a robot: the terms of its environment make the observation, without simulation."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from joshua.api import FieldError, FloatArray, JointSpace, Model, ModelError, Observation, RefusedError, verb
from joshua.api.models import ModelNeeds
from joshua.features import ACTION, STATE, FeatureSet
from joshua.tools import load_target
from joshua_training.run_folder import RunError

from joshua_ppo_trainer.acting_settings import NETWORK, WEIGHTS, PpoPolicySettings

#: Function that makes an environment.
MAKE = "joshua_mujoco_sim.envs:make_environment"

#: Interval between two observations from which on they give no speed, seconds.
_APART_S = 0.5


@dataclass(frozen=True)
class Goal:
    """Target position of the grip, m, in the frame of the simulated model."""

    x: float
    y: float
    z: float


class PpoModel(Model):
    """Runs the mean action of a policy.

    The environment that it was trained in turns joints, their speeds and the goal into the observation, and
    the action into goals of the joints, so scales and meanings are those of the training.
    """

    settings: PpoPolicySettings

    def __init__(
        self, settings: PpoPolicySettings, joints: JointSpace, features: FeatureSet | None = None
    ) -> None:
        super().__init__(settings, joints, features)
        self._goal = np.array(settings.goal_m, np.float64)
        self._environment: Any = None
        self._network: Any = None
        self._last: tuple[int, FloatArray] | None = None

    def load(self) -> None:
        """Load the policy and its environment. Raises ModelError."""
        try:
            about = self.settings.about()
            self._network = _network(self.settings.folder)
            make = load_target(MAKE)
            absolute = about["features"][ACTION].get("unit") == "rad"
            mode = "absolute" if absolute else "delta"
            self._environment = make(about["environment"], action_mode=mode).unwrapped
        except ImportError as error:
            raise ModelError(
                f"{self.settings.folder} requires {error.name}. {self.settings.needs().install}"
            ) from error
        except FieldError as error:
            raise ModelError(f"{error}. {error.remedy}") from error
        except RunError as error:
            raise ModelError(str(error)) from error
        except Exception as error:  # of gymnasium and MuJoCo: the environment is missing, or a different one
            raise ModelError(
                f"{about['environment']}, in which {self.settings.folder} was trained, cannot be made: "
                f"{error}. Install joshua-mujoco-sim"
            ) from error

    def needs(self) -> ModelNeeds:
        """See ``Model``."""
        try:
            return self.settings.needs()
        except FieldError as error:
            raise ModelError(f"{error}. {error.remedy}") from error

    def reset(self) -> None:
        """Start from the present joint positions."""
        self._last = None
        if self._environment is not None:
            self._environment.reset()

    @verb(moves=True)
    def goal(self, request: Goal) -> str:
        """Set the target position of the grip."""
        place = np.array([request.x, request.y, request.z])
        if np.abs(place).max() > 1.0:
            raise RefusedError("the goal is farther than 1 m from the base")
        self._goal = place
        return f"the goal is {request.x:g}, {request.y:g}, {request.z:g} m"

    def act(self, observation: Observation) -> FloatArray:
        """See ``Model``: one step."""
        if self._environment is None:
            raise ModelError(f"{type(self).__name__}: the policy is not loaded: call load first")
        position = np.asarray(observation[STATE], np.float64)
        seen = self._environment.observe_robot(
            position, self._speed(observation.stamp_ns, position), self._goal
        )
        goals = self._environment.goals_of(self._network(seen[None])[0])
        return np.asarray(goals, np.float64)[None]

    def close(self) -> None:
        """Free the environment. Idempotent."""
        environment, self._environment = self._environment, None
        if environment is not None:
            environment.close()

    def _speed(self, stamp_ns: int, position: FloatArray) -> FloatArray:
        """Return the joint speed since the previous observation, rad/s; zero if none is recent."""
        last, self._last = self._last, (stamp_ns, position)
        elapsed_s = (stamp_ns - last[0]) / 1e9 if last is not None else 0.0
        if last is None or not 0.0 < elapsed_s < _APART_S:
            return np.zeros_like(position)
        return (position - last[1]) / elapsed_s


def _network(folder: Path) -> Any:
    """Return the policy as a function of observations, shape (N, K), by NumPy or onnxruntime."""
    if (folder / WEIGHTS).is_file():
        from joshua_ppo_trainer.policy import Policy

        return Policy.load(folder).act
    import onnxruntime

    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    try:
        session = onnxruntime.InferenceSession(
            (folder / NETWORK).read_bytes(), options, providers=["CPUExecutionProvider"]
        )
    except Exception as error:  # of onnxruntime, which has no base class of its own
        said = str(error).strip().partition("\n")[0][:300]
        raise ModelError(f"{folder / NETWORK} cannot be loaded: {said}. Export the policy again") from error
    return lambda seen: session.run(["action"], {"observation": np.asarray(seen, np.float32)})[0]
