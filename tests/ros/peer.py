"""A process of ROS 2's own rclpy: it executes lines of JSON, ``[command, arguments]``, and answers each.

No code of JOSHUA runs here.
"""

# mypy: ignore-errors
from __future__ import annotations

import array
import importlib
import json
import sys
import threading
import time

import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.parameter_client import AsyncParameterClient
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from rclpy.serialization import deserialize_message


def ros_class(name):
    package, kind, message = name.split("/")
    return getattr(importlib.import_module(f"{package}.{kind}"), message)


def profile(values):
    return QoSProfile(
        history=HistoryPolicy[values.get("history", "KEEP_LAST")],
        depth=values.get("depth", 10),
        reliability=ReliabilityPolicy[values.get("reliability", "RELIABLE")],
        durability=DurabilityPolicy[values.get("durability", "VOLATILE")],
    )


class Peer:
    """The commands are its public methods."""

    def __init__(self):
        rclpy.init()
        self._node = rclpy.create_node("peer", namespace="/stock")
        executor = SingleThreadedExecutor()
        executor.add_node(self._node)
        self._publishers = {}
        self._counts = {}
        self._texts = {}
        threading.Thread(target=executor.spin, daemon=True).start()

    def known(self, type_names):
        """Those of the types that are installed here."""
        found = []
        for name in type_names:
            try:
                ros_class(name)
            except (ImportError, AttributeError):
                continue
            found.append(name)
        return found

    def echo(self, pairs):
        """Sends back what comes, read and written by ROS 2's own code; pairs of topic prefix and type."""
        for topic, type_name in pairs:
            kind = ros_class(type_name)
            publisher = self._node.create_publisher(kind, f"{topic}/pong", 10)
            self._node.create_subscription(kind, f"{topic}/ping", publisher.publish, 10)
        return True

    def subscribe(self, topic, type_name, qos):
        self._counts[topic], self._texts[topic] = 0, []

        def take(message):
            self._counts[topic] += 1
            data = getattr(message, "data", "")
            if isinstance(data, str):
                self._texts[topic].append(data)

        self._node.create_subscription(ros_class(type_name), topic, take, profile(qos))
        return True

    def publish(self, topic, type_name, qos, texts):
        if topic not in self._publishers:
            self._publishers[topic] = self._node.create_publisher(ros_class(type_name), topic, profile(qos))
        for text in texts:
            self._publishers[topic].publish(ros_class(type_name)(data=text))
        return True

    def watch_joints(self, topic):
        """Keeps the newest joint state of a topic."""

        def take(message):
            self._texts[topic] = dict(zip(message.name, message.position, strict=True))

        self._texts[topic] = {}
        self._node.create_subscription(ros_class("sensor_msgs/msg/JointState"), topic, take, 10)
        return True

    def play(self, topic, joints, points):
        """Publishes a trajectory once it has a subscriber; points of seconds and positions."""
        publisher = self._node.create_publisher(ros_class("trajectory_msgs/msg/JointTrajectory"), topic, 10)
        point = ros_class("trajectory_msgs/msg/JointTrajectoryPoint")
        message = ros_class("trajectory_msgs/msg/JointTrajectory")(joint_names=joints)
        for at_s, positions in points:
            entry = point(positions=positions)
            entry.time_from_start.sec, entry.time_from_start.nanosec = int(at_s), int(at_s % 1 * 1e9)
            message.points.append(entry)
        while not publisher.get_subscription_count():
            time.sleep(0.01)
        publisher.publish(message)
        return True

    def play_messages(self, topic, type_name, messages):
        """Publishes serialised messages as they are, as rosbag2's player does, once there is a subscriber."""
        publisher = self._node.create_publisher(ros_class(type_name), topic, 10)
        while not publisher.get_subscription_count():
            time.sleep(0.01)
        for message in messages:
            publisher.publish(bytes.fromhex(message))
        return True

    def deserialised(self, type_name, message):
        """The fields of a serialised message that JSON can hold."""
        found = deserialize_message(bytes.fromhex(message), ros_class(type_name))
        values = {name: getattr(found, name) for name in found.get_fields_and_field_types()}
        return {
            name: list(value) if isinstance(value, (array.array, bytes)) else value
            for name, value in values.items()
            if isinstance(value, (str, int, array.array, bytes))
        }

    def matched(self, topic):
        return self._publishers[topic].get_subscription_count()

    def count(self, topic):
        return self._counts[topic]

    def texts(self, topic):
        return self._texts[topic]

    def cpu_s(self):
        """Processor time of this process, which tells a reader that spins from one that waits."""
        return time.process_time()

    def graph(self):
        nodes = [f"{space.rstrip('/')}/{name}" for name, space in self._node.get_node_names_and_namespaces()]
        return {
            "nodes": sorted(nodes),
            "topics": dict(self._node.get_topic_names_and_types()),
            "services": dict(self._node.get_service_names_and_types()),
        }

    def publishers(self, topic):
        return [
            {
                "node": f"{info.node_namespace.rstrip('/')}/{info.node_name}",
                "type": info.topic_type,
                "hash": str(info.topic_type_hash),
                "reliability": info.qos_profile.reliability.name,
                "durability": info.qos_profile.durability.name,
            }
            for info in self._node.get_publishers_info_by_topic(topic)
        ]

    def serve(self, name):
        """Answers a service of type Trigger, and counts its requests."""
        self._counts[name] = 0

        def answer(request, response):
            self._counts[name] += 1
            response.success, response.message = True, "from ROS 2"
            return response

        self._node.create_service(ros_class("std_srvs/srv/Trigger"), name, answer)
        return True

    def call(self, name, seconds):
        """The response of a service of type Trigger; None if none arrives in time, False without a server.

        It asks again: what is sent before the other side knows this client is lost.
        """
        client = self._node.create_client(ros_class("std_srvs/srv/Trigger"), name)
        if not client.wait_for_service(timeout_sec=20.0):
            return False
        asked = []
        for _ in range(round(seconds / 0.5)):
            asked.append(client.call_async(ros_class("std_srvs/srv/Trigger").Request()))
            time.sleep(0.5)
            for future in asked:
                if future.done():
                    return future.result().message
        return None

    def parameters(self, node):
        """Names of the parameters of a node; None if it has no such services."""
        client = AsyncParameterClient(self._node, node)
        if not client.wait_for_services(timeout_sec=1.0):
            return None
        future = client.list_parameters()
        while not future.done():
            time.sleep(0.01)
        return list(future.result().result.names)


peer = Peer()
sys.stdout.write(json.dumps("ready") + "\n")
sys.stdout.flush()
for line in sys.stdin:
    command, arguments = json.loads(line)
    sys.stdout.write(json.dumps(getattr(peer, command)(*arguments)) + "\n")
    sys.stdout.flush()
