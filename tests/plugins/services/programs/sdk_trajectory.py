"""An independent client of FollowJointTrajectory (zenoh-ros2-sdk): sends a goal and waits for its result.

Arguments: port of the router, domain, name of the action, hashes of SendGoal and GetResult. The definitions
are those of control_msgs with their inner messages written out, which is the same on the wire. A list of
messages that is empty in this goal is its length, 0.
"""

# mypy: ignore-errors
import json
import sys
import time
import uuid

import numpy as np
from zenoh_ros2_sdk import ROS2ServiceClient, ZenohSession

INNER = {
    "builtin_interfaces/msg/Time": "int32 sec\nuint32 nanosec",
    "builtin_interfaces/msg/Duration": "int32 sec\nuint32 nanosec",
    "std_msgs/msg/Header": "builtin_interfaces/Time stamp\nstring frame_id",
    "trajectory_msgs/msg/JointTrajectoryPoint": "float64[] positions\nfloat64[] velocities\n"
    "float64[] accelerations\nfloat64[] effort\nbuiltin_interfaces/Duration time_from_start",
    "trajectory_msgs/msg/JointTrajectory": "std_msgs/Header header\nstring[] joint_names\n"
    "trajectory_msgs/JointTrajectoryPoint[] points",
}
GOAL = """uint8[16] goal_id
trajectory_msgs/JointTrajectory trajectory
std_msgs/Header multi_dof_header
string[] multi_dof_joint_names
uint32 multi_dof_points
uint32 path_tolerance
uint32 component_path_tolerance
uint32 goal_tolerance
uint32 component_goal_tolerance
builtin_interfaces/Duration goal_time_tolerance"""
ACCEPTED = "bool accepted\nbuiltin_interfaces/Time stamp"
RESULT = "int8 status\nint32 error_code\nstring error_string"
port, domain, action, *hashes = sys.argv[1:]


def client(name, kind, request, response, type_hash):
    return ROS2ServiceClient(
        service_name=f"{action}/_action/{name}",
        srv_type=f"control_msgs/action/FollowJointTrajectory_{kind}",
        request_definition=request,
        response_definition=response,
        type_hash=type_hash,
        node_name=f"planner_{name}",
        domain_id=int(domain),
        router_port=int(port),
        timeout=20.0,
    )


def call(service, **values):
    for _ in range(50):  # a queryable may become known after its token
        if (response := service.call(**values)) is not None:
            return response
        time.sleep(0.2)
    raise SystemExit("no response")


session = ZenohSession.get_instance("127.0.0.1", int(port))
for name, definition in INNER.items():
    session.register_message_type(definition, name)
send = client("send_goal", "SendGoal", GOAL, ACCEPTED, hashes[0])
result = client("get_result", "GetResult", "uint8[16] goal_id", RESULT, hashes[1])
types = session.store.types
header = types["std_msgs/msg/Header"](types["builtin_interfaces/msg/Time"](0, 0), "")
duration, point = types["builtin_interfaces/msg/Duration"], types["trajectory_msgs/msg/JointTrajectoryPoint"]
none = np.zeros(0)
points = [
    point(np.array(rad), none, none, none, duration(0, nanoseconds))
    for nanoseconds, rad in ((300_000_000, [0.1, 0.0]), (600_000_000, [0.3, -0.2]))
]
trajectory = types["trajectory_msgs/msg/JointTrajectory"](header, ["joint_1", "joint_2"], points)
goal_id = np.frombuffer(uuid.uuid4().bytes, np.uint8)
lengths = ("multi_dof_points", "path_tolerance", "component_path_tolerance", "goal_tolerance")
accepted = call(
    send,
    goal_id=goal_id,
    trajectory=trajectory,
    multi_dof_header=header,
    multi_dof_joint_names=[],
    component_goal_tolerance=0,
    goal_time_tolerance=duration(0, 0),
    **dict.fromkeys(lengths, 0),
)
print(json.dumps({"accepted": bool(accepted.accepted)}), flush=True)
ended = call(result, goal_id=goal_id)
print(json.dumps({"status": int(ended.status), "error": int(ended.error_code), "text": ended.error_string}))
