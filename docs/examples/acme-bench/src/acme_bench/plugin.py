"""What the plugin provides, as data: neither the drivers nor their libraries are imported here."""

from joshua.api import ActuatorSpec, PluginSpec, SensorSpec, hookimpl
from joshua.api.specs import EmulatorSpec

MESSAGES = "acme_bench.bench_pb2"


@hookimpl
def joshua_specs() -> list[PluginSpec]:
    """Name the devices and their emulators."""
    emulators = [
        EmulatorSpec(
            block=block,
            message_module=MESSAGES,
            implementation="acme_bench.emulator:BenchEmulator",
            summary=text,
        )
        for block, text in (
            ("acme.RangeConfig", "range finder on a pseudo-terminal"),
            ("acme.ClampConfig", "clamp on a pseudo-terminal"),
        )
    ]
    return [
        SensorSpec(
            block="acme.RangeConfig",
            message_module=MESSAGES,
            enum_values=("PERCEPTION_PLUGIN",),
            implementation="acme_bench.range_finder:RangeFinder",
            settings="acme_bench.settings:RangeSettings",
            data_types=("sensor_msgs/msg/Range",),
            summary="the ACME range finder",
        ),
        ActuatorSpec(
            block="acme.ClampConfig",
            message_module=MESSAGES,
            enum_values=("ACTION_PLUGIN", "ACTION_FOLLOWER", "ACTION_SINGLE"),
            implementation="acme_bench.clamp:Clamp",
            settings="acme_bench.settings:ClampSettings",
            safe_stop="acme_bench.safe_stop:ClampStop",
            data_types=("sensor_msgs/msg/JointState",),
            summary="the ACME clamp",
        ),
        *emulators,
    ]
