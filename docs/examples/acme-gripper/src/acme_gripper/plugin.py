"""What the plugin provides, as data: neither the driver nor its libraries are imported here."""

from joshua.api import ActuatorSpec, PluginSpec, hookimpl


@hookimpl
def joshua_specs() -> list[PluginSpec]:
    """Name the gripper."""
    return [
        ActuatorSpec(
            block="acme.GripperConfig",
            message_module="acme_gripper.gripper_pb2",
            enum_values=("ACTION_PLUGIN", "ACTION_FOLLOWER", "ACTION_SINGLE"),
            implementation="acme_gripper.actuator:Gripper",
            settings="acme_gripper.settings:GripperSettings",
            data_types=("sensor_msgs/msg/JointState",),
            summary="the ACME gripper, simulated",
        )
    ]
