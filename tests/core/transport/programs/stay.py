"""A process with a router where there is one to host, and a node with both kinds of endpoint."""

import sys

from joshua.plan import QosProfile, TransportSettings
from joshua.transport import open_transport, prepare_transport

spec = TransportSettings.model_validate_json(sys.argv[1])
handle = prepare_transport(spec)
transport = open_transport(spec)
node = transport.create_node("stay")
node.create_publisher("/topic", "std_msgs/msg/String", QosProfile())
node.create_subscription("/topic", "std_msgs/msg/String", QosProfile(), lambda sample: None)
print("ready", flush=True)
sys.stdin.read()
transport.close()
if handle is not None:
    handle.close()
