"""A process with one node: sends everything that comes on /ping back on /pong, until its input ends.

It says «ready» once somebody listens to /pong.
"""

import json
import sys
import time

from joshua.plan import QosProfile, TransportSettings
from joshua.transport import open_transport

spec = TransportSettings.model_validate_json(sys.argv[1])
type_name = sys.argv[2]
qos = QosProfile(**json.loads(sys.argv[3])) if len(sys.argv) > 3 else QosProfile()
transport = open_transport(spec)
node = transport.create_node("echo", "/far")
publisher = node.create_publisher("/pong", type_name, qos)
node.create_subscription("/ping", type_name, qos, lambda sample: publisher.publish(sample.cdr))
while not publisher.subscription_count:  # what is sent before has nobody to come to
    time.sleep(0.01)
print("ready", flush=True)
sys.stdin.read()
transport.close()
