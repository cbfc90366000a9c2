"""What the plan hands to a node beside its settings: one class of facts per kind of node.

Plain dataclasses, which ``NodeSpec`` carries as JSON over the control socket of a child process.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, ClassVar, Literal

from joshua.plan.feature import Feature
from joshua.plan.joints import JointRange
from joshua.plan.model_needs import Compute, Execution

#: pydantic refuses an unknown name, so that a misspelt fact is no silent one.
_STRICT = {"extra": "forbid"}


@dataclass(frozen=True, kw_only=True)
class NodeFacts:
    """What every node can be told.

    Attributes:
        testing: the run is a test, and the node judges its device.
        use_sim_time: the node follows the time of the simulation.
        restarted: it ran before and failed.
        hang_after_s, ready_timeout_s, stop_timeout_s: what the supervisor grants it; 0 takes the one of
            its kind.
    """

    __pydantic_config__: ClassVar[dict[str, str]] = _STRICT

    testing: bool = False
    use_sim_time: bool = False
    restarted: bool = False
    hang_after_s: float = 0.0
    ready_timeout_s: float = 0.0
    stop_timeout_s: float = 0.0


@dataclass(frozen=True)
class Commander:
    """A node that may command an actuator.

    Attributes:
        node: its full name; topic: on which it publishes.
        joints: of a leader arm, whose positions are mapped; None for a node that sends radians.
        override: it takes control from the others, until it is released.
        motion_rad: of a joint after which an override takes control; 0 for its first command.
    """

    node: str
    topic: str
    joints: tuple[JointRange, ...] | None = None
    override: bool = False
    motion_rad: float = 0.0


@dataclass(frozen=True)
class OnStale:
    """What joints do that hold because commands stopped.

    Attributes:
        action: ``RELEASE`` or ``PARK_THEN_RELEASE``; after_s: how long they hold.
        pose_rad, timeout_s: of a park.
    """

    action: str
    after_s: float
    pose_rad: tuple[float, ...]
    timeout_s: float


@dataclass(frozen=True)
class SafeStop:
    """What the guardian of an actuator does.

    Attributes:
        implementation: import string of the plugin's ``safe_stop``.
        state: ``HOLD``, ``RELEASE`` or ``PARK_THEN_RELEASE``; park_pose_rad, timeout_s: of a park.
    """

    implementation: str
    state: str
    park_pose_rad: tuple[float, ...]
    timeout_s: float


@dataclass(frozen=True)
class RunFacts:
    """The run that a node belongs to: log file, control socket, and where e-stops are kept."""

    log: str = ""
    socket: str = ""
    robot: str = ""
    domain_id: int = 0
    latch_folder: str = ""
    estop_files: str = ""


@dataclass(frozen=True, kw_only=True)
class ActuatorFacts(NodeFacts):
    """What an actuator's node is told.

    Attributes:
        joints: of the device, in joint order.
        commanders: every node of the run whose commands count, overrides included, in the order of the file.
        external: command topics on which publishers outside the file count, too; they send radians.
        stale_after_s: age of a command that holds the joints; None takes the usual one.
        safe_state: ``HOLD``, ``RELEASE`` or ``PARK_THEN_RELEASE``.
        safe_stop: of its guardian; None where it has none.
        estop_action: import string of what releases the joints without the driver; "" if none.
        keeps_last_goal: nothing stops the joints when the driver dies.
        intervention: it says whether a person has taken over from a model.
        on_stale: what becomes of the joints when commands stay away; None holds them.
        allow_uncalibrated: joints without calibration may be energised.
        dry_run: everything is done with torque off.
        simulation: settings of the simulation that the device is part of; None for any other.
        run: the run that it belongs to.
    """

    kind: Literal["actuator"] = "actuator"
    joints: tuple[JointRange, ...] = ()
    commanders: tuple[Commander, ...] = ()
    external: tuple[str, ...] = ()
    stale_after_s: float | None = None
    safe_state: str = "HOLD"
    safe_stop: SafeStop | None = None
    estop_action: str = ""
    keeps_last_goal: bool = False
    intervention: bool = False
    on_stale: OnStale | None = None
    allow_uncalibrated: bool = False
    dry_run: bool = False
    simulation: dict[str, Any] | None = None
    run: RunFacts = field(default_factory=RunFacts)


@dataclass(frozen=True, kw_only=True)
class SensorFacts(NodeFacts):
    """What a sensor's node is told.

    Attributes:
        joints: that its commands reach; () where it sends none, or not all of them are known.
        terminal: it reads the terminal that the run was started from.
        simulation: settings of the simulation that the device is part of; None for any other.
    """

    kind: Literal["sensor"] = "sensor"
    joints: tuple[JointRange, ...] = ()
    terminal: bool = False
    simulation: dict[str, Any] | None = None


@dataclass(frozen=True, kw_only=True)
class ModelFacts(NodeFacts):
    """What a model's node is told.

    Attributes:
        joints: that it commands; features: of its subscriptions, by the model's keys.
        task: instruction in natural language.
        execution, compute: of the file.
        reads_task: it does nothing without a task.
        interventions: topics of the actuators that it commands, which say whether a person has taken over.
    """

    kind: Literal["model"] = "model"
    joints: tuple[JointRange, ...] = ()
    features: tuple[Feature, ...] = ()
    task: str = ""
    execution: Execution = field(default_factory=Execution)
    compute: Compute = field(default_factory=Compute)
    reads_task: bool = False
    interventions: tuple[str, ...] = ()


@dataclass(frozen=True)
class ChosenEnvironment:
    """What the file says about the environment of a training, checked.

    Attributes:
        environment_id: such as ``joshua/SoArm100Reach-v0``; reward_function: one that it offers, never "".
        num_envs: how many step at once; seed: of the first one, None for none in particular.
        make: import string of what makes it, see ``EnvironmentSpec``.
    """

    environment_id: str
    reward_function: str
    num_envs: int
    seed: int | None
    make: str


@dataclass(frozen=True, kw_only=True)
class ServiceFacts(NodeFacts):
    """What the node of a service is told.

    Attributes:
        folder: of the configuration, at which relative paths start.
        physics_socket: where a simulation answers to emulated devices; "" where it need not.
        environment: that a trainer learns in; None where it needs none.
        features: of a data store: what the robot shows and does, each with its topic.
        arms: ranges of the joints by the key of a feature, such as ``observation.state`` and ``action``.
        commands: topic that commands the arm of an ``action``, by the key of that feature.
        robot_type: ``general.robot_type``.
    """

    kind: Literal["service"] = "service"
    folder: str = ""
    physics_socket: str = ""
    environment: ChosenEnvironment | None = None
    features: tuple[Feature, ...] = ()
    arms: dict[str, tuple[JointRange, ...]] = field(default_factory=dict)
    commands: dict[str, str] = field(default_factory=dict)
    robot_type: str = ""


Facts = ActuatorFacts | SensorFacts | ModelFacts | ServiceFacts
