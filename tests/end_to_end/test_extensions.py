"""A mode, a service with topics, a command, a verb and a transport, in files of their own alone."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import pytest
from eventually import eventually
from joshua.testing.domain import reserved_domain
from joshua.testing.program import JoshuaProgram

FILES = {
    "toy_patrol/__init__.py": "",
    "toy_patrol/plugin.py": """
from joshua.api import hookimpl
from joshua.api.specs import ModeOffer


@hookimpl
def joshua_specs():
    return [ModeOffer(name="patrol", enum_values=("MODE_PLUGIN",), implementation="toy_patrol.mode:SPEC")]
""",
    "toy_patrol/mode.py": """
from joshua.api.modes import ModeSpec, ServiceSpec, ServiceTopic, lacks


def check(context):
    if not context.graph.actuators:
        yield lacks(context, "mode-lacks-actuator", "an arm to walk with", "robot", remedy="Add an arm")


def topics(graph, config):
    yield ServiceTopic("/patrol/point", "std_msgs/msg/String", is_publisher=True, rate_hz=20.0)
    yield ServiceTopic("/arm/joint_states", "sensor_msgs/msg/JointState")


PATROL = ServiceSpec(
    "general.plugin_config", node_name="patrol", behaviour="toy_patrol.node:Patrol", topics=topics
)
SPEC = ModeSpec("patrol", check, services=(PATROL,))
""",
    "toy_patrol/node.py": '''
from dataclasses import dataclass

from joshua.api import verb
from joshua.api.nodes import NodeBehaviour
from joshua.messages import message_class


@dataclass(frozen=True)
class Where:
    point: str = "gate"


@dataclass(frozen=True)
class Seen:
    point: str
    arms: int


class Patrol(NodeBehaviour):
    def configure(self):
        self.point, self.arms = "door", 0
        (out,) = self.context.spec.publishers
        (arm,) = self.context.spec.subscriptions
        self.publisher = self.context.publisher(out)
        self.context.subscribe(arm, self.heard)

    def activate(self):
        text = message_class("std_msgs/msg/String")
        self.context.create_timer(0.05, lambda: self.publisher.publish(text(self.point)), name="point")

    def heard(self, message, received_ns):
        self.arms = len(message.name)

    @verb(moves=False)
    def go(self, where: Where) -> Seen:
        """Goes to a point, and says what it sees of the arm."""
        self.point = where.point
        return Seen(self.point, self.arms)

    @verb(moves=False)
    def report(self) -> str:
        """Says where it is."""
        return f"at the {self.point}"

    @verb(moves=True)
    def march(self) -> str:
        """Walks."""
        return "never over the network"
''',
    "toy_patrol/report.py": """
SUMMARY = "say what the patrol is for"


def add_arguments(parser):
    parser.add_argument("--loud", action="store_true")


def run(arguments):
    print("ALL QUIET" if arguments.loud else "all quiet")
    return 0
""",
    "toy_patrol-1.0.dist-info/METADATA": "Metadata-Version: 2.1\nName: toy-patrol\nVersion: 1.0\n",
    "toy_patrol-1.0.dist-info/entry_points.txt": (
        "[joshua.plugins]\npatrol = toy_patrol.plugin\n[joshua.commands]\npatrol-report = toy_patrol.report\n"
    ),
}
POST = {
    "toy_post/__init__.py": "",
    "toy_post/plugin.py": """
from joshua.api import hookimpl
from joshua.api.specs import TransportSpec


@hookimpl
def joshua_specs():
    return [
        TransportSpec(
            enum_values=("TRANSPORT_PLUGIN",),
            name="post",
            implementation="toy_post.transport:PostTransport",
            prepare="toy_post.boxes:prepare",
            rmw_implementations=("rmw_post_cpp",),
        )
    ]
""",
    "toy_post/boxes.py": """
import os
import pathlib

FOLDER = pathlib.Path(os.environ["TOY_POST"])


class Boxes:
    description = "has letter boxes"

    def close(self):
        pass


def prepare(settings):
    FOLDER.mkdir(exist_ok=True)
    return Boxes()
""",
    "toy_post/transport.py": """
import contextlib
import socket
import threading
import time

from joshua.api import transports

from toy_post.boxes import FOLDER


def boxes(topic):
    return FOLDER.glob(topic.replace("/", "-") + ".*")


class PostPublisher(transports.Publisher):
    def __init__(self, node, topic):
        super().__init__(node, topic)
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)

    def publish(self, cdr):
        for box in boxes(self.topic):
            with contextlib.suppress(OSError):
                self._socket.sendto(bytes(cdr), str(box))

    @property
    def subscription_count(self):
        return len(list(boxes(self.topic)))

    def assert_liveliness(self):
        pass

    def _leave(self):
        self._socket.close()


class PostSubscription(transports.Subscription):
    publisher_count = 1

    def __init__(self, node, topic, callback):
        super().__init__(node, topic)
        self._box = FOLDER / f"{topic.replace('/', '-')}.{id(self)}"
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self._socket.bind(str(self._box))
        self._callback = callback
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def _run(self):
        while letter := self._socket.recv(1 << 16):
            self._callback(transports.Sample(letter, 0, time.time_ns(), 0, b""))

    def _leave(self):
        self._box.unlink()
        self._socket.shutdown(socket.SHUT_RD)
        self._thread.join()
        self._socket.close()


class PostNode(transports.NodeHandle):
    def publisher_node(self, publisher_gid):
        return ""

    def _make_publisher(self, topic, type_name, qos, emit):
        return PostPublisher(self, topic)

    def _make_subscription(self, topic, type_name, qos, callback, emit):
        return PostSubscription(self, topic, callback)

    def _leave(self):
        pass


class PostTransport(transports.Transport):
    connected = True
    meeting_point = "the letter boxes"

    def nodes(self):
        return []

    def _make_node(self, name, namespace):
        return PostNode(self, name, namespace)

    def _leave(self):
        pass
""",
    "toy_post-1.0.dist-info/METADATA": "Metadata-Version: 2.1\nName: toy-post\nVersion: 1.0\n",
    "toy_post-1.0.dist-info/entry_points.txt": "[joshua.plugins]\npost = toy_post.plugin\n",
}
ROBOT = """
general { mode: MODE_PLUGIN plugin_mode: "patrol" name: "walker" id: "walker-001" }
robot { actions {
  node { node_name: "arm" node_id: 1
    publishers { data_type: JOINT_STATE topic_name: "/arm/joint_states" publish_rate_hz: 20 } }
  action_type: ACTION_SINGLE mock_motor_config { num_motors: 2 position_max: 4095 } } }
"""


@pytest.fixture
def joshua(tmp_path: Path) -> Iterator[JoshuaProgram]:
    site = tmp_path / "site"
    for name, text in (FILES | POST).items():
        path = site / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
    (tmp_path / "robot.pbtxt").write_text(ROBOT, encoding="utf-8")
    # the letter boxes are sockets, whose paths must be short
    with reserved_domain() as domain_id, TemporaryDirectory(prefix="post") as boxes:
        program = JoshuaProgram(tmp_path, domain_id, {"PYTHONPATH": str(site), "TOY_POST": boxes})
        yield program
        program.close()


def call(joshua: JoshuaProgram) -> dict[str, Any]:
    said = joshua("call", "patrol", "go", "point=bridge", "--format", "json")
    assert said.returncode == 0, said.stderr
    reply: dict[str, Any] = json.loads(said.stdout)
    return reply


def test_it_is_listed_with_its_mode_and_its_command(joshua: JoshuaProgram) -> None:
    rows = {row["name"]: row for row in json.loads(joshua("plugins", "--json").stdout)}
    assert (rows["toy-patrol"]["status"], rows["toy-patrol"]["reasons"]) == ("ok", [])
    assert joshua("patrol-report", "--loud").stdout == "ALL QUIET\n"


def test_its_mode_is_checked_planned_and_run_and_its_verb_is_called(
    joshua: JoshuaProgram, tmp_path: Path
) -> None:
    assert joshua("--config", "robot.pbtxt", "--validate-only").returncode == 0
    empty = joshua("--config", "robot.pbtxt", "--set", "robot { }", "--validate-only")
    assert "needs an arm to walk with" in empty.stderr + empty.stdout
    assert "/patrol/point" in joshua("plan", "--config", "robot.pbtxt").stdout
    run = joshua.start("--config", "robot.pbtxt")
    assert run.stdout is not None
    assert run.stderr is not None
    assert any(" ready after " in line for line in run.stdout), run.stderr.read()
    # its subscription is served: at some time it has heard of the two joints of the arm
    eventually(lambda: call(joshua)["arms"] == 2, "a message of the arm")
    assert call(joshua)["point"] == "bridge"
    # verbs without a request are services of ROS 2, too; one that moves is refused, because anybody may call
    place = f'transport {{ kind: TRANSPORT_ZENOH listen_endpoints: "{joshua.router}" }}'
    (tmp_path / "place.pbtxt").write_text(place, encoding="utf-8")
    said = joshua("service", "call", "/patrol/report", "--config=place.pbtxt")
    assert said.stdout.splitlines() == ["success: true", "message: at the bridge"], said.stderr
    refused = joshua("service", "call", "/patrol/march", "--config=place.pbtxt")
    assert refused.returncode == 1
    assert "only the user who runs the robot may call it" in refused.stdout
    status = ("status", "--format", "json")
    eventually(lambda: "/patrol/point" in joshua(*status).stdout, "the rate of its topic")
    joshua.stop(run)
    assert run.returncode == 0


def test_its_transport_carries_the_topics_of_a_run(joshua: JoshuaProgram, tmp_path: Path) -> None:
    (tmp_path / "post.pbtxt").write_text(
        ROBOT + 'transport { kind: TRANSPORT_PLUGIN plugin_kind: "post" }', encoding="utf-8"
    )
    assert joshua("plugins", "--check").returncode == 0
    assert "transport: post (domain" in joshua("plan", "--config", "post.pbtxt").stdout
    missing = joshua("plan", "--config", "post.pbtxt", "--block-plugin", "toy-post")
    assert "no plugin in use does (toy-post is blocked)" in " ".join(missing.stderr.split())
    run = joshua.start("--config", "post.pbtxt")
    assert run.stdout is not None
    assert run.stderr is not None
    assert any(" ready after " in line for line in run.stdout), run.stderr.read()
    # the joints of the arm came through the letter boxes
    eventually(lambda: call(joshua)["arms"] == 2, "a message of the arm")
    joshua.stop(run)
    assert run.returncode == 0


def test_the_kind_of_a_plugin_and_its_name_belong_together(joshua: JoshuaProgram, tmp_path: Path) -> None:
    for text, said in (
        ("transport { kind: TRANSPORT_PLUGIN }", "TRANSPORT_PLUGIN requires plugin_kind"),
        ('transport { plugin_kind: "post" }', "plugin_kind has no effect without kind: TRANSPORT_PLUGIN"),
    ):
        (tmp_path / "wrong.pbtxt").write_text(ROBOT + text, encoding="utf-8")
        done = joshua("--config", "wrong.pbtxt", "--validate-only")
        assert done.returncode == 2
        assert said in " ".join((done.stdout + done.stderr).split())
