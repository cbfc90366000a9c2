"""ROS 2 message classes and their CDR encoding, without a ROS 2 installation."""

from joshua.messages.codec import decode as decode
from joshua.messages.codec import encode as encode
from joshua.messages.codec import preload as preload
from joshua.messages.typestore import MessageError as MessageError
from joshua.messages.typestore import dds_type_name as dds_type_name
from joshua.messages.typestore import distro as distro
from joshua.messages.typestore import known_types as known_types
from joshua.messages.typestore import message_class as message_class
from joshua.messages.typestore import ros_type_name as ros_type_name
from joshua.messages.typestore import select_distro as select_distro
from joshua.messages.typestore import type_hash as type_hash
