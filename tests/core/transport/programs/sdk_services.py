"""An independent peer over Zenoh (zenoh-ros2-sdk): a SetBool server, and a client of a service.

Arguments: port of the router, domain, service to call.
"""

# mypy: ignore-errors
import json
import sys
import time

from zenoh_ros2_sdk import ROS2ServiceClient, ROS2ServiceServer

SET_BOOL = "std_srvs/srv/SetBool"
place = {"router_ip": "127.0.0.1", "router_port": int(sys.argv[1]), "domain_id": int(sys.argv[2])}
definitions = {"request_definition": "bool data", "response_definition": "bool success\nstring message"}


def serve(request):
    return server.response_msg_class(success=True, message=f"the sdk got {request.data}")


server = ROS2ServiceServer(
    service_name="/sdk/greet",
    srv_type=SET_BOOL,
    callback=serve,
    node_name="sdk_server",
    **definitions,
    **place,
)
client = ROS2ServiceClient(
    service_name=sys.argv[3], srv_type=SET_BOOL, node_name="sdk_client", **definitions, **place
)
print("ready", flush=True)
for _ in range(100):
    response = client.call(data=True)
    if response is not None:
        break
    time.sleep(0.1)
print(json.dumps({"success": bool(response.success), "message": response.message}), flush=True)
sys.stdin.read()
