"""Diagnostic codes of planning: plugins, settings, hosts and the transport."""

from __future__ import annotations

from joshua.textproto.code_doc import CodeDoc

PLANNING_CODES: dict[str, CodeDoc] = {
    "plugin-missing": CodeDoc(
        "A block or a model needs a plugin that is not installed, blocked, broken or cannot do this yet.",
        "Do what the message says, which names a distribution; `joshua plugins` lists what is installed.",
    ),
    "extra-missing": CodeDoc(
        "The chosen transport needs an extra of joshua-core that is not installed.",
        "Install the extra that the message names, or choose another transport.",
    ),
    "broken-plugin": CodeDoc(
        "A plugin is installed and its settings cannot be loaded.",
        "Install the plugin anew, or leave it out with --block-plugin.",
    ),
    "block-unknown": CodeDoc(
        "--block-plugin names a plugin that is not installed, so it blocks nothing.",
        "Correct the name; `joshua plugins` lists what is installed.",
    ),
    "invalid-setting": CodeDoc(
        "A block breaks a rule of the plugin that runs it.",
        "Change the value as the message says.",
    ),
    "emulator-missing": CodeDoc(
        "A device of the file has no emulator, and --emulate never opens a real one.",
        "Install joshua-emulator, or leave the device out of the file.",
    ),
    "fault-node-unknown": CodeDoc(
        "--fault names a node that is no emulated device of the file.",
        "Name one of the devices: --fault NODE:FAULT.",
    ),
    "terminal-shared": CodeDoc(
        "Two nodes of one machine read the terminal, and each key reaches one of them only.",
        "Put the controls of both into one keyboard_config.",
    ),
    "native-missing": CodeDoc(
        "A node asks for node_type CPP, and its plugin has no native implementation.",
        "Nothing: the Python implementation runs. Set node_type to PYTHON to silence the note.",
    ),
    "qos-acts-partly": CodeDoc(
        "ROS 2's Zenoh middleware does not apply deadline, lifespan, lease duration and manual liveliness.",
        "Nothing between JOSHUA nodes, where they act; choose DDS where ROS 2 nodes must apply them too.",
    ),
    "environment-unknown": CodeDoc(
        "environment_id names no environment that an installed plugin offers.",
        "Correct the id; the message lists those that are known, the nearest first.",
    ),
    "reward-unknown": CodeDoc(
        "reward_function names no reward of the environment, or of any environment where none is named.",
        "Correct the name; the message lists those that the environment offers, the nearest first.",
    ),
    "environment-needed": CodeDoc(
        "Learning in simulation, and neither environment_id nor reward_function says which task.",
        "Name an environment in ai.training.environment_id.",
    ),
    "unknown-host": CodeDoc(
        "--host names a machine that no node of the file names.",
        "Name a host of the file, or set `host` in its nodes.",
    ),
    "host-needed": CodeDoc(
        "Every node of the file names a host, so this machine's share is not known.",
        "Add --host with the name of this machine.",
    ),
    "transport-environment": CodeDoc(
        "RMW_IMPLEMENTATION, ROS_DOMAIN_ID or ROS_AUTOMATIC_DISCOVERY_RANGE has a value that ROS 2 does "
        "not know.",
        "Set one of the allowed values, or unset the variable.",
    ),
}
