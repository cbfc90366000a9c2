"""Declarations of plugins as data: one frozen class per kind, without importing a driver."""

from __future__ import annotations

from dataclasses import FrozenInstanceError, dataclass
from typing import TYPE_CHECKING, Any, ClassVar

if TYPE_CHECKING:
    from typing_extensions import Self, dataclass_transform
else:

    def dataclass_transform(**_options: object) -> Any:
        """Replacement for a decorator that only type checkers read."""
        return lambda cls: cls


@dataclass_transform(frozen_default=True, kw_only_default=True)
class _Spec:
    """Base of specs. Like frozen dataclasses, without the time of ``dataclass`` for each class.

    Every check of a file imports these classes.
    """

    if not TYPE_CHECKING:

        def __init__(self, **values: Any) -> None:
            known = [vars(cls).get("__annotations__", {}) for cls in type(self).__mro__]
            fields = {name for kinds in known for name in kinds if "ClassVar" not in str(kinds[name])}
            for name in values.keys() - fields:
                raise TypeError(f"{type(self).__name__}() got an unexpected keyword argument {name!r}")
            if "implementation" not in values:
                raise TypeError(f"{type(self).__name__}() missing the keyword argument 'implementation'")
            vars(self).update(values)

    def replace(self, **values: Any) -> Self:
        """Return a copy of the spec with changed values."""
        return type(self)(**{**vars(self), **values})

    def __setattr__(self, name: str, value: object) -> None:
        raise FrozenInstanceError(f"cannot assign to field {name!r}")

    def __repr__(self) -> str:
        return (
            f"{type(self).__name__}({', '.join(f'{name}={value!r}' for name, value in vars(self).items())})"
        )


class PluginSpec(_Spec):
    """A declaration of a plugin, the base of all kinds.

    Import strings look like ``acme.gripper:Gripper``; "" for none.

    Attributes:
        base: import string of the base class of ``implementation``, "" for any.
        block: configuration block that selects it: a member of a oneof such as ``sts3215_config``, or the
            full name of a registered message (``acme.GripperConfig``); "" if only the enum value selects it.
        enum_values: supported enum values, such as ``("ACTION_LEADER", "ACTION_FOLLOWER")``.
        implementation: import string of the class or function.
        settings: import string of the pydantic settings model for the block.
        message_module: import string of the ``_pb2`` module that registers the block's own message.
        summary: one line for ``joshua plugins``.
    """

    kind: ClassVar[str] = ""
    base: ClassVar[str] = ""

    block: str = ""
    implementation: str
    enum_values: tuple[str, ...] = ()
    settings: str = ""
    message_module: str = ""
    summary: str = ""


class NodePluginSpec(PluginSpec):
    """A declaration that runs in a node, with a standard behaviour.

    Attributes:
        standard_behaviour: import string of the node behaviour of the kind.
        behaviour: import string of a custom node behaviour, which may use any ``implementation``.
        native: import string of the native implementation for ``node_type: CPP``.
        hang_after_s: time without a heartbeat that counts as a hang, for a device that waits for a radio and
            stops by itself without commands; 0 for the default of the kind.
        ready_timeout_s: time limit for opening the device or model; 0 for the default of the kind.
    """

    standard_behaviour: ClassVar[str] = ""

    behaviour: str = ""
    native: str = ""
    hang_after_s: float = 0.0
    ready_timeout_s: float = 0.0


class DeviceSpec(NodePluginSpec):
    """An actuator or a sensor.

    Attributes:
        data_types: ROS 2 types that a third party's device can publish, such as
            ``("sensor_msgs/msg/Image",)``, for checks without the driver; () if undeclared.
        virtual: it has no hardware, so ``--emulate`` does not replace it.
    """

    data_types: tuple[str, ...] = ()
    virtual: bool = False


class ActuatorSpec(DeviceSpec):
    """An actuator.

    Attributes:
        safe_stop: import string of the guardian's action: a class that derives from
            ``joshua.guardian.safe_stop.SafeStopRequest`` and is importable without numpy. Without one the
            start-up table warns: if the driver dies, the joints keep their last goal.
        stops_itself: the device has a dead-man's switch that stops the joints without a driver, so it needs
            no ``safe_stop``.
        bus_tools: import string of the ``BusTools`` of an actuator on a bus of motors, with which `joshua
            find-port`, `joshua motors` and `joshua doctor` work outside a run.
    """

    kind: ClassVar[str] = "actuator"
    base: ClassVar[str] = "joshua.devices.actuator:Actuator"
    standard_behaviour: ClassVar[str] = "joshua.devices.actuator_node:ActuatorNode"

    safe_stop: str = ""
    stops_itself: bool = False
    bus_tools: str = ""


class SensorSpec(DeviceSpec):
    """A sensor.

    Attributes:
        terminal: the node reads the terminal of the run. Only one node of a run may do so.
    """

    kind: ClassVar[str] = "sensor"
    base: ClassVar[str] = "joshua.devices.sensor:Sensor"
    standard_behaviour: ClassVar[str] = "joshua.devices.sensor_node:SensorNode"

    terminal: bool = False


class ModelSpec(NodePluginSpec):
    """A policy.

    Attributes:
        packaged_files: import string of a light function that takes the name of weights, such as
            ``joshua/so_arm100/reach``, and returns the path of the plugin's weights of that name, or None.
    """

    kind: ClassVar[str] = "model"
    base: ClassVar[str] = "joshua.models.model:Model"
    standard_behaviour: ClassVar[str] = "joshua_inference.node:InferenceNode"

    packaged_files: str = ""


class StoreSpec(PluginSpec):
    """A data store: ``implementation`` is the behaviour of its node.

    Attributes:
        all_topics: it subscribes to all topics of the run, not only to those of features.
    """

    kind: ClassVar[str] = "store"
    base: ClassVar[str] = "joshua.node.behaviour:Store"

    all_topics: bool = False


class EpisodeWriterSpec(PluginSpec):
    """A layout of data sets."""

    kind: ClassVar[str] = "episode writer"
    base: ClassVar[str] = "joshua.features.episodes:EpisodeWriter"


class TrainerSpec(PluginSpec):
    """A trainer: ``implementation`` is the behaviour of its node."""

    kind: ClassVar[str] = "trainer"
    base: ClassVar[str] = "joshua.node.behaviour:Trainer"


class SimulatorSpec(PluginSpec):
    """A simulator: ``implementation`` is the behaviour of its node.

    Attributes:
        sim_adapter: import string of its ``joshua.plugins.emulator.SimAdapter``, with which ``--sim``
            replaces real devices by simulated ones.
        packaged_files: import string of a light function that takes a name, such as a ``model_path``, and
            returns the path of the plugin's file of that name, or None.
    """

    kind: ClassVar[str] = "simulator"
    base: ClassVar[str] = "joshua.node.behaviour:Simulator"

    sim_adapter: str = ""
    packaged_files: str = ""


class EmulatorSpec(PluginSpec):
    """An emulated device."""

    kind: ClassVar[str] = "emulator"
    base: ClassVar[str] = "joshua.plugins.emulator:DeviceEmulator"


class ModeOffer(PluginSpec):
    """An operation mode: ``implementation`` is its ``joshua.modes.ModeSpec``.

    ``enum_values`` is one mode of the schema, or MODE_PLUGIN for a mode of the plugin. ``block`` is the
    message of its settings in ``general.plugin_config``; "" if it has none.

    Attributes:
        name: of a mode of the plugin, as in ``general.plugin_mode``.
    """

    kind: ClassVar[str] = "mode"

    name: str = ""


class TransportSpec(PluginSpec):
    """A transport of ROS 2 topics: ``implementation`` derives from ``joshua.api.transports.Transport``.

    ``enum_values`` is one kind of the schema, or TRANSPORT_PLUGIN for a kind of the plugin.

    Attributes:
        name: of a kind of the plugin, as in ``transport.plugin_kind``.
        rmw_implementations: values of ``RMW_IMPLEMENTATION`` that select it, in addition to those of ROS 2.
        library: required module, which is searched for but not imported; "" for none.
        prepare: import string of a light function that the supervisor calls with the ``TransportSettings``
            before nodes start. It raises ``TransportError`` if they cannot be used on this machine, and
            returns an object that it hosts for the nodes, or None.
        limits: parts of ROS 2 that it does not support and what to do, a sentence of the start-up table.
    """

    kind: ClassVar[str] = "transport"
    base: ClassVar[str] = "joshua.transport.transports:Transport"

    name: str = ""
    rmw_implementations: tuple[str, ...] = ()
    library: str = ""
    prepare: str = ""
    limits: str = ""

    @staticmethod
    def short(enum_value: str) -> str:
        """Name of a kind of the schema: ``dds`` for TRANSPORT_DDS."""
        return enum_value.removeprefix("TRANSPORT_").lower()

    @staticmethod
    def long(name: str) -> str:
        """Enum value of a kind: TRANSPORT_DDS for ``dds``."""
        return f"TRANSPORT_{name.upper()}"


class ExtensionSpec(PluginSpec):
    """An addition to every node in the ROS 2 graph, such as services.

    ``implementation`` is a function that takes a ``joshua.api.nodes.ExtendedNode``, called once when the node
    is activated over a transport that supports services. Its exceptions become warnings of the node. Its
    module is imported once, by the process that nodes are forked from, so its import must start no thread.

    Attributes:
        name: of the extension.
    """

    kind: ClassVar[str] = "extension"

    name: str


@dataclass(frozen=True)
class Environment:
    """A task for trainers, as data.

    Attributes:
        id: value of ``environment_id``, such as ``joshua/SoArm100Reach-v0``.
        rewards: values of ``reward_function``, the default first.
        summary: one line for people.
    """

    id: str
    rewards: tuple[str, ...]
    summary: str = ""


class EnvironmentSpec(PluginSpec):
    """Tasks for trainers. ``implementation`` is a function that makes any of them.

    ``make(environment_id, reward_function=…, num_envs=…, seed=…)`` returns a vectorised environment.

    Attributes:
        environments: at least one.
    """

    kind: ClassVar[str] = "environment"

    environments: tuple[Environment, ...] = ()
