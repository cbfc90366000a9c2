"""A process that sends every message of every type back: /ping/t<n> to /pong/t<n>, until its input ends.

It says «ready» once somebody listens to each /pong.
"""

import sys
import time
from collections.abc import Callable

from joshua.plan import QosProfile, TransportSettings
from joshua.transport import Publisher, Sample, open_transport


def back(publisher: Publisher) -> Callable[[Sample], None]:
    """What sends a sample back."""
    return lambda sample: publisher.publish(sample.cdr)


spec = TransportSettings.model_validate_json(sys.argv[1])
transport = open_transport(spec)
node = transport.create_node("echo")
publishers = []
for number, type_name in enumerate(sys.argv[2].split(",")):
    publisher = node.create_publisher(f"/pong/t{number}", type_name, QosProfile())
    publishers.append(publisher)
    node.create_subscription(f"/ping/t{number}", type_name, QosProfile(), back(publisher))
while not all(publisher.subscription_count for publisher in publishers):
    time.sleep(0.01)
print("ready", flush=True)
sys.stdin.read()
transport.close()
