"""ROS 2 message classes and their CDR encoding, without a ROS 2 installation."""

from joshua.messages.codec import decode, encode, preload
from joshua.messages.errors import MessageError
from joshua.messages.names import dds_type_name, ros_type_name
from joshua.messages.typestore import distro, known_types, message_class, select_distro, type_hash

__all__ = [
    "MessageError",
    "dds_type_name",
    "decode",
    "distro",
    "encode",
    "known_types",
    "message_class",
    "preload",
    "ros_type_name",
    "select_distro",
    "type_hash",
]
