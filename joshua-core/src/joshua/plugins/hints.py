"""Which distribution provides which block, so that a missing plugin can be named.

This is data for messages only: what runs is decided by the registry, never by this table.
"""

from __future__ import annotations

from dataclasses import dataclass

from joshua.plugins.specs import PluginSpec, StoreSpec


@dataclass(frozen=True)
class KnownPlugin:
    """A published plugin: what it answers for.

    Attributes:
        distribution: name for ``pip install``.
        blocks: configuration blocks that need it.
        enum_values: enum values that name it on their own, whatever the block.
        commands: commands of ``joshua`` that it brings.
    """

    distribution: str
    blocks: tuple[str, ...] = ()
    enum_values: tuple[str, ...] = ()
    commands: tuple[str, ...] = ()


KNOWN_PLUGINS: tuple[KnownPlugin, ...] = (
    KnownPlugin(
        "joshua-core",
        (
            "mock_motor_config",
            "mock_camera_config",
            "mock_encoder_config",
            "mock_lidar_config",
            "random_noise_config",
        ),
        ("RANDOM_NOISE", "ACTION_MOCK"),
    ),
    KnownPlugin("joshua-serial", commands=("find-port",)),
    KnownPlugin("joshua-servo", commands=("motors",)),
    KnownPlugin("joshua-sts3215", ("sts3215_config",)),
    KnownPlugin("joshua-dynamixel", ("dynamixel_config",)),
    KnownPlugin("joshua-spike", ("spike_motor_config",), ("ACTION_SPIKE",)),
    KnownPlugin("joshua-camera", ("camera_config",), ("PERCEPTION_CAMERA",), ("find-cameras",)),
    KnownPlugin("joshua-lidar", ("lidar_config",), ("PERCEPTION_LIDAR",)),
    KnownPlugin("joshua-encoder", ("encoder_config",), ("PERCEPTION_ENCODER",)),
    KnownPlugin(
        "joshua-teleop-input",
        ("gamepad_config", "keyboard_config"),
        ("PERCEPTION_GAMEPAD", "PERCEPTION_KEYBOARD"),
        ("find-gamepads", "share-gamepad"),
    ),
    KnownPlugin("joshua-calibration", enum_values=("MODE_CALIBRATION",), commands=("calibrate",)),
    KnownPlugin("joshua-smolvla", (), ("SMOLVLA",)),
    KnownPlugin(
        "joshua-mujoco-sim",
        ("simulation", "sim_config", "sim_camera_config"),
        ("INTERACTIVE", "PASSIVE", "MIRROR", "OFFSCREEN"),
        ("models", "sim"),
    ),
    KnownPlugin(
        "joshua-dataset",
        ("data_store",),
        (
            "FORMAT_HUGGINGFACE",
            "FORMAT_CSV",
            "FORMAT_JSONL",
            "FORMAT_PARQUET",
            "STORAGE_LOCAL",
            "STORAGE_CLOUD",
        ),
    ),
    KnownPlugin("joshua-imitation", ("imitation_config", "eval_config"), ("METHOD_IMITATION", "METHOD_EVAL")),
    KnownPlugin("joshua-mjx-trainer", (), ("BACKEND_MJX",)),
    KnownPlugin("joshua-isaac-trainer", (), ("BACKEND_ISAAC",)),
    KnownPlugin("joshua-ppo-trainer", ("rl_config",), ("METHOD_RL",)),
)

#: What no published plugin does yet, by block, and what there is in its place.
NOT_YET = {
    "data_store": (
        "recording, replaying on a robot and uploading data sets are not available yet: joshua-dataset only "
        "writes the episodes that a simulation generates",
        "leave the data_store block out until then, and MODE_DATA_STORE with it; "
        "simulation { mode: OFFSCREEN generate { ... } } makes a data set, and mode: PASSIVE replays one",
    ),
}


def not_yet(kind: type[PluginSpec], block: str) -> tuple[str, str]:
    """What a block asks for that no published plugin does yet, and what to do; empty texts where one does."""
    return NOT_YET.get(block, ("", "")) if kind is StoreSpec else ("", "")


def distribution_for(block: str, enum_value: str = "") -> str:
    """Names the published plugin for a block, else for an enum value; "" where none is known.

    The simulator of ``rl_config`` decides its trainer, so that an enum value of a backend goes first there.
    A block with a dot is a message of a third party, whose package nobody here knows.
    """
    if enum_value.startswith("BACKEND_"):
        return _by_enum_value(enum_value)
    for known in KNOWN_PLUGINS:
        if block and block in known.blocks:
            return known.distribution
    return "" if "." in block else _by_enum_value(enum_value)


def subject(block: str, enum_value: str = "") -> str:
    """What needs the plugin, in words of the file: the enum value, and the block where it takes both."""
    if not enum_value or not block:
        return enum_value or block
    named = _by_enum_value(enum_value)
    if named and named == distribution_for(block, enum_value):
        return enum_value
    return f"{enum_value} with {block}"


def _by_enum_value(enum_value: str) -> str:
    for known in KNOWN_PLUGINS:
        if enum_value and enum_value in known.enum_values:
            return known.distribution
    return ""
