"""An independent peer over Zenoh, the package zenoh-ros2-sdk: publishes, subscribes and lists the graph."""

import json
import sys
import time

from zenoh_ros2_sdk import ROS2Publisher, ROS2Subscriber, get_topic_info

port, domain = int(sys.argv[1]), int(sys.argv[2])
common = {
    "msg_type": "std_msgs/msg/String",
    "msg_definition": "string data\n",
    "domain_id": domain,
    "router_port": port,
}
heard = []
publisher = ROS2Publisher("/from_sdk", node_name="sdk_talker", **common)
subscriber = ROS2Subscriber(
    "/to_sdk", callback=lambda message: heard.append(message.data), node_name="sdk_listener", **common
)
print("ready", flush=True)
end_s = time.monotonic() + 60
while not heard and time.monotonic() < end_s:
    publisher.publish(data="hello from the sdk")
    time.sleep(0.05)
info = get_topic_info("/to_sdk", domain_id=domain, router_port=port, verbose=True)
assert info is not None
talker = info.publishers[0]
print(
    json.dumps(
        {
            "heard": heard[:1],
            "node": [talker.node_namespace, talker.node_name],
            "type": talker.topic_type,
            "hash": talker.type_hash,
            "qos": talker.qos,
        }
    ),
    flush=True,
)
sys.stdin.read()
