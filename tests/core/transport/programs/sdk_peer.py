"""An independent peer over Zenoh, the package zenoh-ros2-sdk: publishes, subscribes and reads the graph."""

import json
import sys
import time
from typing import Any

from zenoh_ros2_sdk import ROS2Publisher, ROS2Subscriber, ZenohSession
from zenoh_ros2_sdk.discovery import _parse_liveliness_keyexpr

port, domain = int(sys.argv[1]), int(sys.argv[2])
common = {
    "msg_type": "std_msgs/msg/String",
    "msg_definition": "string data\n",
    "domain_id": domain,
    "router_port": port,
}
heard: list[str] = []
talkers: list[dict[str, Any]] = []


def on_token(sample: Any) -> None:
    """Reads a liveliness token with the parser of the SDK."""
    found = _parse_liveliness_keyexpr(str(sample.key_expr))
    if found and found["qualified_name"].endswith("to_sdk") and found["kind"] == "MP":
        talkers.append(found)


publisher = ROS2Publisher("/from_sdk", node_name="sdk_talker", **common)
subscriber = ROS2Subscriber(
    "/to_sdk", callback=lambda message: heard.append(message.data), node_name="sdk_listener", **common
)
session = ZenohSession.get_instance("127.0.0.1", port)
# the SDK asks for tokens once, which may find nothing while sessions still exchange what they know
watch: Any = session.liveliness.declare_subscriber(f"@ros2_lv/{domain}/**", on_token, history=True)
print("ready", flush=True)
end_s = time.monotonic() + 60
while not (heard and talkers) and time.monotonic() < end_s:
    publisher.publish(data="hello from the sdk")
    time.sleep(0.05)
keys = ("namespace", "node_name", "dds_type", "type_hash", "qos")
print(json.dumps({"heard": heard[0], **{key: talkers[0][key] for key in keys}}), flush=True)
sys.stdin.read()
