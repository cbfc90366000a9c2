"""Diagnostic codes of the rules that concern one block: fields, names, blocks that fit, limits, rates."""

from __future__ import annotations

from joshua.textproto.code_doc import CodeDoc

FIELD_CODES: dict[str, CodeDoc] = {
    # Rules of the fields
    "required-missing": CodeDoc(
        "A block lacks a field or block that it cannot do without.",
        "Add what the message names; the example in it is a good start.",
    ),
    "not-chosen": CodeDoc(
        "An enum field is written with its …_UNSPECIFIED value, which stands for «not chosen».",
        "Write one of the values that are allowed.",
    ),
    "empty-text": CodeDoc(
        "A text that must say something is empty.",
        "Write a value between the quotes.",
    ),
    "out-of-range": CodeDoc(
        "A number lies outside the range of its field.",
        "Write a number in the range; mind the unit.",
    ),
    "not-finite": CodeDoc(
        "A number is nan or inf, with which nothing can be computed.",
        "Write a finite number.",
    ),
    "not-allowed": CodeDoc(
        "A text field has a fixed set of values, and this is none of them.",
        "Write one of the values that are allowed.",
    ),
    "too-few-entries": CodeDoc(
        "A list has fewer entries than it needs.",
        "Add entries.",
    ),
    "too-many-entries": CodeDoc(
        "A list has more entries than one device or block takes.",
        "Remove entries, or divide them among several blocks.",
    ),
    "duplicate-entry": CodeDoc(
        "An entry stands twice in a list in which each may stand once.",
        "Remove one of the two.",
    ),
    "limits-inverted": CodeDoc(
        "A lower limit is not below its upper limit, so no value is allowed.",
        "Exchange the two values or correct one.",
    ),
    # Names
    "topic-name-invalid": CodeDoc(
        "A topic name breaks a naming rule of ROS 2, which refuses it.",
        "Rename the topic; use letters, digits and underscores between slashes.",
    ),
    "topic-name-reserved": CodeDoc(
        "A topic name has two underscores in a row, which the conventions of ROS 2 keep for its own use.",
        "Use single underscores.",
    ),
    "topic-name-hidden": CodeDoc(
        "A part of a topic name starts with an underscore, so ROS 2 tools do not list it.",
        "Remove the underscore unless the topic is meant to be hidden.",
    ),
    "node-name-invalid": CodeDoc(
        "A node name breaks a naming rule of ROS 2, which refuses it.",
        "Use letters, digits and underscores, and no digit at the start.",
    ),
    "namespace-invalid": CodeDoc(
        "A namespace breaks a naming rule of ROS 2, which refuses it.",
        "Start it with a slash and use letters, digits and underscores between slashes.",
    ),
    "frame-invalid": CodeDoc(
        "A frame id breaks a rule of tf2.",
        "Leave out the leading slash and white space.",
    ),
    "robot-id-invalid": CodeDoc(
        "general.id names a folder and a file and holds characters that do not belong into file names.",
        "Use letters, digits, underscores, dots and hyphens.",
    ),
    "host-invalid": CodeDoc(
        "Node.host is no name of a machine.",
        "Write the name that `joshua --host NAME` is given on that machine.",
    ),
    "uuid-invalid": CodeDoc(
        "A UUID is not of the 36-character form.",
        "Copy it in full, such as c5f50001-8280-46da-89f4-6d8051e4aeef.",
    ),
    "usb-id-invalid": CodeDoc(
        "vid_pid is not of the form 1a86:55d3.",
        "Copy vendor and product id from lsusb.",
    ),
    "pixel-format-invalid": CodeDoc(
        "A pixel format is not a code of four characters.",
        "Write a code that the camera lists, such as MJPG or YUYV.",
    ),
    # Blocks that belong together
    "block-missing": CodeDoc(
        "The type of a device, model, store or training asks for a settings block that is not there.",
        "Add the block that the message names.",
    ),
    "block-unfit": CodeDoc(
        "The settings block is that of another type.",
        "Change the block or the type so that the two belong together.",
    ),
    "block-unused": CodeDoc(
        "A block stands in the file and has no effect in this mode or with this method.",
        "Remove it, or change what the message names.",
    ),
    "field-unused": CodeDoc(
        "A field is set and has no effect beside the other settings.",
        "Remove it, or change the setting that makes it useless.",
    ),
    "simulation-missing": CodeDoc(
        "A simulated device stands in a file without a simulation block.",
        "Add the simulation block that names the model.",
    ),
    "controls-missing": CodeDoc(
        "A gamepad or keyboard has no controls, so it moves nothing.",
        "Add a controls block for each joint.",
    ),
    "link-missing": CodeDoc(
        "comm does not say how the device is connected.",
        "Add a serial or ble block to it.",
    ),
    "link-unfit": CodeDoc(
        "The device cannot be reached by the link that is given.",
        "Give the link that the message names.",
    ),
    "weights-missing": CodeDoc(
        "A learned model is given no weights.",
        "Add pretrained_model_name_or_path with a hub id or a folder.",
    ),
    # Rates
    "rate-above-camera": CodeDoc(
        "Pictures are to be published faster than the camera delivers them.",
        "Lower publish_rate_hz to the camera's fps or raise fps.",
    ),
    "rate-above-bus": CodeDoc(
        "One cycle of the servo bus takes longer than the period of the publish rate, as the message shows.",
        "Lower publish_rate_hz, raise the baud rate, or put fewer servos on one bus.",
    ),
    "rate-tight-on-bus": CodeDoc(
        "The servo bus carries the rate only without the delay that USB adapters have.",
        "Lower publish_rate_hz to the rate that the message names.",
    ),
}
