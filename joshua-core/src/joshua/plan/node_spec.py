"""One node of the plan: its implementation, settings and topics."""

from __future__ import annotations

from enum import Enum
from typing import Annotated, Any, TypeVar

from pydantic import Field, model_validator
from typing_extensions import Self

from joshua.plan.facts import Facts, NodeFacts
from joshua.plan.qos import QosProfile
from joshua.plan.report import Value

FactsT = TypeVar("FactsT", bound=NodeFacts)


class NodeKind(str, Enum):
    """The kind of a node."""

    ACTUATOR = "actuator"
    SENSOR = "sensor"
    MODEL = "model"
    SERVICE = "service"


class TopicSpec(Value):
    """One endpoint of a node.

    Attributes:
        name: fully qualified topic name, such as ``/leader/joint_states``.
        type_name: ROS 2 type, such as ``sensor_msgs/msg/JointState``.
        qos: the effective profile after defaults, overrides and adoption.
        rate_hz: configured rate of a publisher; 0 for a subscription.
    """

    name: str
    type_name: str
    qos: QosProfile = QosProfile()
    rate_hz: float = 0.0


class NodeSpec(Value):
    """Everything that a child process needs to run one node, without device handles or code.

    Attributes:
        name: ROS 2 base name; namespace: with leading slash; frame_id: of stamped messages.
        node_id: number of the node in the file.
        kind: the kind of the node.
        role: enum value of the file, such as ``ACTION_LEADER`` or ``PERCEPTION_CAMERA``.
        block: configuration block that selects the implementation, such as ``mock_motor_config``.
        plugin: distribution that provides the implementation.
        behaviour: import string of the node behaviour, such as ``joshua.devices.actuator_node:ActuatorNode``.
        implementation: import string of the driver or model class that the behaviour drives.
        settings_type: import string of the settings model; settings: its JSON-able content.
        facts: values of the plan beside the settings, of the class for its kind.
        backend: the implementation in the start-up table, such as ``python`` or ``native``.
        publishers, subscriptions: endpoints.
        process_group: nodes with the same group share a process; "" for a separate process.
        interpreter: Python interpreter; "" for the Node Generator's own.
        host: machine that runs the node; "" for any.
        restart: ``on-failure``, ``never`` or ``stop-run``.
        extensions: import strings of the extensions that plugins add to the node.
    """

    name: str
    namespace: str = "/"
    frame_id: str = ""
    node_id: int = 0
    kind: NodeKind
    role: str = ""
    block: str = ""
    plugin: str = "joshua-core"
    behaviour: str
    implementation: str
    settings_type: str = ""
    settings: dict[str, Any] = Field(default_factory=dict)
    # _names_the_kind_of_its_facts always replaces this default.
    facts: Annotated[Facts, Field(discriminator="kind")] = None  # type: ignore[assignment]
    backend: str = "python"
    publishers: tuple[TopicSpec, ...] = ()
    subscriptions: tuple[TopicSpec, ...] = ()
    process_group: str = ""
    interpreter: str = ""
    host: str = ""
    restart: str = "on-failure"
    extensions: tuple[str, ...] = ()

    @model_validator(mode="before")
    @classmethod
    def _names_the_kind_of_its_facts(cls, values: Any) -> Any:
        """Facts may be omitted or plain values, which then have the kind of the node."""
        if not isinstance(values, dict) or not isinstance(values.get("facts", {}), dict):
            return values
        return values | {"facts": {"kind": values.get("kind")} | values.get("facts", {})}

    @model_validator(mode="after")
    def _has_facts_of_its_kind(self) -> Self:
        if self.facts.kind != self.kind.value:
            raise ValueError(f"the facts of {self.name} are facts of a {self.facts.kind}")
        return self

    def facts_as(self, kind: type[FactsT]) -> FactsT:
        """The facts of a node, of one class. Raises TypeError if they have another."""
        if not isinstance(self.facts, kind):
            raise TypeError(f"{self.full_name} is no node with {kind.__name__}")
        return self.facts

    @property
    def full_name(self) -> str:
        """Fully qualified node name, such as ``/left/follower_arm``."""
        return f"{self.namespace.rstrip('/')}/{self.name}"
