"""A process that published five numbers before anyone listened, and one more when it is told."""

import json
import sys

from joshua.messages import encode, message_class
from joshua.plan import QosProfile, TransportSettings
from joshua.transport import open_transport

UINT32 = "std_msgs/msg/UInt32"
transport = open_transport(TransportSettings.model_validate_json(sys.argv[1]))
qos = QosProfile(**json.loads(sys.argv[2]))
publisher = transport.create_node("latched").create_publisher("/topic", UINT32, qos)
for value in range(5):
    publisher.publish(encode(message_class(UINT32)(value)))
print("ready", flush=True)
sys.stdin.readline()
publisher.publish(encode(message_class(UINT32)(5)))
sys.stdin.read()
transport.close()
