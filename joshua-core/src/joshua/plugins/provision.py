"""What a plugin provides, as data: no driver is imported to describe it."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum


class ProvisionKind(str, Enum):
    """The kinds of things that a plugin can provide."""

    ACTUATOR = "actuator"
    SENSOR = "sensor"
    MODEL = "model"
    STORE = "store"
    TRAINER = "trainer"
    SIMULATOR = "simulator"
    EMULATOR = "emulator"
    ENVIRONMENT = "environment"
    EPISODE_WRITER = "episode writer"


@dataclass(frozen=True)
class Environment:
    """A task that trainers can learn, as data.

    Attributes:
        id: what ``environment_id`` takes, such as ``joshua/SoArm100Reach-v0``.
        rewards: what ``reward_function`` takes, the default first.
        summary: one line for people.
    """

    id: str
    rewards: tuple[str, ...]
    summary: str = ""


@dataclass(frozen=True)
class Provision:
    """One thing that a plugin provides.

    Attributes:
        kind: what it is.
        block: configuration block that asks for it: a member of the fixed oneofs such as
            ``sts3215_config``, or the full name of a registered message (``acme.GripperConfig``) for an
            ``Any`` block; "" where the enum value alone decides.
        enum_values: enum values that fit, such as ``("ACTION_LEADER", "ACTION_FOLLOWER")``.
        implementation: import string of the class, such as ``joshua_sts3215.actuator:Sts3215Actuator``.
        settings: import string of the pydantic settings model, made from the block.
        message_module: import string of the ``_pb2`` module that registers the block's message;
            "" for built-in blocks.
        behaviour: import string of the node behaviour; "" takes the standard one of the kind.
        data_types: ROS 2 types that a device of a third party can publish, such as
            ``("sensor_msgs/msg/Image",)``, so that a file is checked without the driver; () says nothing.
        native: import string of the native implementation that ``node_type: CPP`` asks for; "" if none.
        summary: one line for ``joshua plugins``.
        safe_stop: import string of what the guardian of an actuator runs: a function, importable without
            numpy, that takes what ``Actuator.safe_stop_request`` prepared, brings the device into its safe
            state without the driver, and returns a report with ``complete`` and ``joints``; "" if none.
        bus_tools: import string of the ``BusTools`` of an actuator on a bus of motors, with which `joshua
            find-port`, `joshua motors` and `joshua doctor` work outside a run; "" where there is no such bus.
        packaged_files: import string of a light function that takes a name, such as a ``model_path``, and
            returns the path of the file of that name which ships with the plugin, or None; "" if none.
        stand_in: import string of what ``--sim`` asks of a simulator: a function that takes the
            configuration, its ``RealDevice``s and whether their buses are emulated. It puts blocks of
            simulated devices in their place, and returns the ``CoupledArm`` or ``CoupledCamera`` of each
            emulated device by node name; "" if none.
        virtual: there is no hardware behind it, so that ``--emulate`` leaves it as it is.
        hang_after_s: silence of the node's loop that counts as a hang, for a device that waits for a radio
            and stops by itself when nothing comes; 0 takes the one of the kind.
        ready_timeout_s: time that the node may take to open its device; 0 takes the one of the kind.
        terminal: the node reads the terminal that the run was started from; one node of a run may.
        environments: of a provision of kind ENVIRONMENT, whose implementation is a function that makes any of
            them: ``make(environment_id, reward_function=…, num_envs=…, seed=…)`` returns a vectorised one.
    """

    kind: ProvisionKind
    block: str
    implementation: str
    settings: str = ""
    enum_values: tuple[str, ...] = ()
    message_module: str = ""
    behaviour: str = ""
    native: str = ""
    data_types: tuple[str, ...] = ()
    summary: str = ""
    safe_stop: str = ""
    bus_tools: str = ""
    packaged_files: str = ""
    stand_in: str = ""
    virtual: bool = False
    hang_after_s: float = 0.0
    ready_timeout_s: float = 0.0
    terminal: bool = False
    environments: tuple[Environment, ...] = ()
