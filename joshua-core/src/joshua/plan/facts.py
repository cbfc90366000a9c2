"""The facts that the plan passes to a node beside its settings: one class per kind of node.

Plain dataclasses, which ``NodeSpec`` carries as JSON over the control socket of a child process.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, ClassVar, Literal

from joshua.plan.feature import Feature
from joshua.plan.joints import JointRange
from joshua.plan.model_needs import Compute, Execution

#: pydantic rejects an unknown name, so a misspelt fact is not ignored.
_STRICT = {"extra": "forbid"}


@dataclass(frozen=True, kw_only=True)
class NodeFacts:
    """Facts of every node.

    Attributes:
        testing: the run is a test, in which the node evaluates its device.
        use_sim_time: the node follows the time of the simulation.
        restarted: it ran and failed before.
        hang_after_s, ready_timeout_s, stop_timeout_s: limits of the supervisor; 0 for the default of its
            kind.
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
        node: its full name; topic: its command topic.
        joints: of a leader arm, whose positions are mapped; None for a node that sends radians.
        override: it takes control from the others until it is released.
        motion_rad: of a joint after which an override takes control; 0 for its first command.
    """

    node: str
    topic: str
    joints: tuple[JointRange, ...] | None = None
    override: bool = False
    motion_rad: float = 0.0


@dataclass(frozen=True)
class OnStale:
    """Action of joints that hold because commands stopped.

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
    """Action of an actuator's guardian.

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
    """The run of a node.

    Attributes:
        log: its file; socket: its control socket.
        robot: ``general.id`` of its file; domain_id: ROS 2 domain; source: the file; run: its name.
        latch_folder, estop_files: of the e-stops.
        energised_folder: of the records of actuators with torque; "" if their devices end with the run.
        options: words of the command line that change what the file says, such as ``--set``.
    """

    log: str = ""
    socket: str = ""
    robot: str = ""
    domain_id: int = 0
    latch_folder: str = ""
    estop_files: str = ""
    source: str = ""
    run: str = ""
    energised_folder: str = ""
    options: tuple[str, ...] = ()


@dataclass(frozen=True, kw_only=True)
class ActuatorFacts(NodeFacts):
    """Facts of an actuator's node.

    Attributes:
        joints: of the device, in joint order.
        commanders: every node of the run that may command it, including overrides, in the order of the file.
        external: command topics that accept publishers outside the file, which send radians.
        stale_after_s: age of a command after which the joints hold; None for the default.
        safe_state: ``HOLD``, ``RELEASE`` or ``PARK_THEN_RELEASE``.
        safe_stop: of its guardian; None if it has none.
        estop_action: import string of the action that releases the joints without the driver; "" if none.
        keeps_last_goal: nothing stops the joints if the driver dies.
        intervention: it publishes whether a person has taken over from a model.
        on_stale: action of the joints when commands stop for long; None to hold.
        allow_uncalibrated: joints without calibration may be energised.
        dry_run: the torque stays off.
        simulation: settings of the simulation of the device; None for a real device.
        source: the configuration; overrides: its ``--set`` options; node_name: in the configuration.
        run: its run.
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
    source: str = ""
    overrides: tuple[str, ...] = ()
    node_name: str = ""
    run: RunFacts = field(default_factory=RunFacts)


@dataclass(frozen=True, kw_only=True)
class SensorFacts(NodeFacts):
    """Facts of a sensor's node.

    Attributes:
        joints: those that it commands; () if it commands none, or not all are known.
        terminal: it reads the terminal that the run was started from.
        simulation: settings of the simulation of the device; None for a real device.
    """

    kind: Literal["sensor"] = "sensor"
    joints: tuple[JointRange, ...] = ()
    terminal: bool = False
    simulation: dict[str, Any] | None = None


@dataclass(frozen=True)
class ModelArm:
    """One of several arms of a model.

    Attributes:
        commands, state: its topics; joints: its names of its joints.
        prefix: before these names in the model, such as ``left_``; "" if no other arm has one of them.
    """

    commands: str
    state: str
    joints: tuple[str, ...]
    prefix: str = ""

    @property
    def names(self) -> tuple[str, ...]:
        """The model's names of its joints."""
        return tuple(self.prefix + name for name in self.joints)


@dataclass(frozen=True, kw_only=True)
class ModelFacts(NodeFacts):
    """Facts of a model's node.

    Attributes:
        joints: those that it commands; features: of its subscriptions, by the model's keys. The states of
            several arms are one feature without a topic if the model has one state.
        arms: several arms; () for one.
        task: instruction in natural language.
        execution, compute: of the file.
        reads_task: it does nothing without a task.
        interventions: topics of its actuators that report whether a person has taken over.
        is_judged: it acts in episodes only, which it reports on ``~/episode``.
        awaits_weights: it starts without a model, and gets weights by its verb ``use_weights``.
    """

    kind: Literal["model"] = "model"
    joints: tuple[JointRange, ...] = ()
    arms: tuple[ModelArm, ...] = ()
    features: tuple[Feature, ...] = ()
    task: str = ""
    execution: Execution = field(default_factory=Execution)
    compute: Compute = field(default_factory=Compute)
    reads_task: bool = False
    interventions: tuple[str, ...] = ()
    is_judged: bool = False
    awaits_weights: bool = False


@dataclass(frozen=True)
class ChosenEnvironment:
    """The environment of a training, checked.

    Attributes:
        environment_id: such as ``joshua/SoArm100Reach-v0``; reward_function: one of its rewards, never "".
        num_envs: number of parallel environments; seed: of the first one, None for a random one.
        make: import string of its factory, see ``EnvironmentSpec``.
    """

    environment_id: str
    reward_function: str
    num_envs: int
    seed: int | None
    make: str


@dataclass(frozen=True, kw_only=True)
class ServiceFacts(NodeFacts):
    """Facts of a service's node.

    Attributes:
        folder: of the configuration, to which paths are relative.
        physics_socket: of a simulation for emulated devices; "" for none.
        environment: of a trainer; None if it needs none.
        features: of a data store: observations and actions of the robot, with their topics.
        arms: ranges of the joints by the key of a feature, such as ``observation.state`` and ``action``.
        commands: command topic of the arm of an ``action``, by the key of that feature.
        robot_type: ``general.robot_type``.
        configuration: text of the whole configuration without ``include``, for a trainer; else "".
    """

    kind: Literal["service"] = "service"
    folder: str = ""
    configuration: str = ""
    physics_socket: str = ""
    environment: ChosenEnvironment | None = None
    features: tuple[Feature, ...] = ()
    arms: dict[str, tuple[JointRange, ...]] = field(default_factory=dict)
    commands: dict[str, str] = field(default_factory=dict)
    robot_type: str = ""


Facts = ActuatorFacts | SensorFacts | ModelFacts | ServiceFacts
