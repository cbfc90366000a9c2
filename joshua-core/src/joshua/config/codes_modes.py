"""Diagnostic codes of the operation modes and of the files that a run reads."""

from __future__ import annotations

from joshua.textproto.code_doc import CodeDoc

MODE_CODES: dict[str, CodeDoc] = {
    # What a mode needs
    "mode-lacks-block": CodeDoc(
        "The mode needs a block that the file does not have.",
        "Add the block, or choose another mode.",
    ),
    "mode-lacks-field": CodeDoc(
        "The mode needs a field that may be left out elsewhere.",
        "Add the field.",
    ),
    "mode-lacks-device": CodeDoc(
        "MODE_TEST has no device to test.",
        "Add an actions or perceptions block.",
    ),
    "mode-lacks-actuator": CodeDoc(
        "The mode needs an actuator of a certain kind.",
        "Add the actions block that the message describes.",
    ),
    "mode-lacks-leader": CodeDoc(
        "Teleoperation has nothing that a person drives with.",
        "Add a leader arm, a gamepad or a keyboard that publishes JOINT_STATE.",
    ),
    "mode-lacks-follower": CodeDoc(
        "Teleoperation has nothing that is driven.",
        "Add an actuator that subscribes to the leader's topic.",
    ),
    "mode-lacks-model": CodeDoc(
        "Inference has no model.",
        "Add ai { models { … } }.",
    ),
    "mode-lacks-publisher": CodeDoc(
        "A node that the mode builds on publishes nothing.",
        "Add a publishers block to it.",
    ),
    "follower-without-leader": CodeDoc(
        "A follower subscribes to no topic that the file publishes, so it would never move.",
        "Subscribe to the topic that the leader publishes.",
    ),
    "joint-count-mismatch": CodeDoc(
        "Leader and follower have different numbers of motors.",
        "List as many motors in both blocks.",
    ),
    "model-drives-nothing": CodeDoc(
        "No actuator subscribes to the actions of a model.",
        "Let the actuator subscribe to the topic that the model publishes.",
    ),
    "model-without-camera": CodeDoc(
        "A vision model subscribes to no camera.",
        "Add a subscription to a camera's topic.",
    ),
    "dataset-mismatch": CodeDoc(
        "Training asks for another data set than the data store beside it holds.",
        "Write the same dataset_name in both blocks.",
    ),
    "mapping-duplicate": CodeDoc(
        "Two mappings drive the same actuator of the simulation model.",
        "Keep one of them.",
    ),
    "mapping-type": CodeDoc(
        "A mirror follows joint states, and the topic carries another type.",
        "Map a JOINT_STATE topic.",
    ),
    "mapping-unpublished": CodeDoc(
        "No node of the file publishes the topic that the mirror follows.",
        "Correct the name, or start the robot's own file beside this one.",
    ),
    # Files that a run reads: notes under --validate-only, errors at launch
    "input-file-missing": CodeDoc(
        "A file that the configuration names does not exist; a relative path starts at the naming file.",
        "Correct the path or put the file there.",
    ),
    "input-file-is-folder": CodeDoc(
        "A folder stands where a file is needed.",
        "Name a file.",
    ),
    "input-file-unreadable": CodeDoc(
        "The operating system does not let this user read a file that the configuration names.",
        "Change the permissions of the file.",
    ),
    "output-path-is-file": CodeDoc(
        "A file stands where the run needs a folder of its own.",
        "Choose another path or move the file away.",
    ),
    "weights-not-found": CodeDoc(
        "The weights of a model are neither a path that exists nor a hub id.",
        "Correct the path, train the model first, or write a hub id such as lerobot/smolvla_base.",
    ),
    "interpreter-missing": CodeDoc(
        "The Python interpreter that a node names does not exist or cannot be run.",
        "Create the environment or correct the path of its bin/python.",
    ),
    "dataset-missing": CodeDoc(
        "The data set to upload, replay or train on is not there.",
        "Record it first, or correct its name or path.",
    ),
    "dataset-exists": CodeDoc(
        "Episodes are to be made, and the folder of their data set is not empty.",
        "Name another local_path, or move the folder away: a data set is never overwritten.",
    ),
}
