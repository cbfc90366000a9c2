"""Another user of this machine watches over TCP, and commands nothing."""

from __future__ import annotations

import contextlib
import json
import os
import threading
from pathlib import Path

import pytest
from joshua.messages import encode, make
from joshua.plan import QosProfile
from joshua.transport import TransportError, prepare_transport
from joshua.transport.zenoh.keys import data_key
from second_user import needs_second_user

JOINT_STATE = "sensor_msgs/msg/JointState"
TRIGGER = "std_srvs/srv/Trigger"

pytestmark = needs_second_user


@pytest.fixture
def run_spec(zenoh_spec, tmp_path):
    """As for the nodes of a run: with a folder for the sockets between them."""
    folder = tmp_path / "links"
    folder.mkdir(mode=0o700)
    return zenoh_spec.model_copy(update={"link_folder": str(folder)})


def tcp_ports(process_id):
    """Ports on which a process accepts TCP connections."""
    inodes = set()
    for link in Path(f"/proc/{process_id}/fd").iterdir():
        with contextlib.suppress(FileNotFoundError):  # closed meanwhile
            inodes.add(str(link.readlink()).removeprefix("socket:[").removesuffix("]"))
    rows = [line.split() for line in Path("/proc/net/tcp").read_text().splitlines()[1:]]
    listening = [row for row in rows if row[3] == "0A" and row[9] in inodes]
    return sorted(int(row[1].split(":")[1], 16) for row in listening)


class Robot:
    """A leader, a follower that listens to it and offers a service, and what came to the follower."""

    def __init__(self, spec, opener, eventually):
        self.spec = spec
        self.got, self.calls = [], []
        self.leader, self.follower = opener(spec), opener(spec)
        arm = self.follower.create_node("follower")
        arm.create_subscription("/commands", JOINT_STATE, QosProfile(), self.got.append)
        arm.create_service("/follower/stop", TRIGGER, self.serve)
        node = self.leader.create_node("leader")
        self.publisher = node.create_publisher("/commands", JOINT_STATE, QosProfile())
        eventually(lambda: self.publisher.subscription_count == 1, what="the match")

    def serve(self, request):
        self.calls.append(request)
        return b"\0\1\0\0\1\0\0\0\0\0\0\0"

    def command(self):
        self.publisher.publish(encode(make.joint_state(["a"], [0.5])))

    def arguments(self):
        domain = self.spec.domain_id
        own = next(entity for entity in self.leader.graph.entities("MP"))
        return [
            ",".join(map(str, tcp_ports(os.getpid()))),
            domain,
            data_key(domain, "/commands", JOINT_STATE),
            data_key(domain, "/follower/stop", TRIGGER),
            own.token,
            own.gid.hex(),
        ]


def read_report(process, act):
    """The report of the attacker, while the robot goes on."""
    lines = []
    thread = threading.Thread(target=lambda: lines.append(process.stdout.readline()))
    thread.start()
    while thread.is_alive():
        act()
        thread.join(0.05)
    return json.loads(lines[0])


def test_another_user_watches_and_commands_nothing(run_spec, opener, program, eventually, second_user):
    handle = prepare_transport(run_spec)
    try:
        robot = Robot(run_spec, opener, eventually)
        attacker = program("other_user.py", second_user.uid, *robot.arguments())
        report = read_report(attacker, robot.command)
        assert len(report) == 6, "two ports and three ways: nothing else accepts connections"
        assert list(report.values()) == [{"heard": True, "saw": True, "answers": 0}] * 6
        assert robot.calls == []
        assert {sample.publisher_gid for sample in robot.got} == {robot.publisher._gid}
        assert all(b"forged" not in bytes(sample.cdr) for sample in robot.got)
        # nothing of the attacker came into the graph either
        assert {node.name for node in robot.follower.nodes()} == {"leader", "follower"}
    finally:
        handle.close()


def test_with_open_to_local_users_the_same_attack_succeeds(
    run_spec, opener, program, eventually, second_user
):
    """Shows that the attack of the other test is one."""
    spec = run_spec.model_copy(update={"open_to_local_users": True})
    handle = prepare_transport(spec)
    try:
        robot = Robot(spec, opener, eventually)
        attacker = program("other_user.py", second_user.uid, *robot.arguments())
        report = read_report(attacker, robot.command)
        assert all(one["answers"] for one in report.values()), report
        assert robot.calls
        assert any(b"forged" in bytes(sample.cdr) for sample in robot.got)
    finally:
        handle.close()


def test_a_router_that_another_user_started_is_named_and_refused(zenoh_spec, program, second_user):
    port = int(zenoh_spec.listen_endpoints[0].rsplit(":", 1)[1])
    foreign = program("foreign_router.py", second_user.uid, port)
    assert foreign.stdout.readline() == "ready\n"
    with pytest.raises(TransportError) as refused:
        prepare_transport(zenoh_spec)
    assert str(refused.value) == (
        f"user {second_user.shown} started the program on tcp/localhost:{port}, which could read every "
        "message of this run and withhold them. Ask that user to stop it, set other listen_endpoints in the "
        "transport block, or set open_to_local_users: true there to join it and let every user of this "
        "machine command this robot"
    )
    joined = prepare_transport(zenoh_spec.model_copy(update={"open_to_local_users": True}))
    try:
        assert joined.description == f"joined the Zenoh router on tcp/localhost:{port}"
    finally:
        joined.close()


def test_a_router_of_this_user_that_admits_everyone_gets_no_command_through(
    run_spec, opener, program, eventually, second_user
):
    """Such as ROS 2's own router, which was started first."""
    port = run_spec.listen_endpoints[0].rsplit(":", 1)[1]
    foreign = program("foreign_router.py", 0, port)
    assert foreign.stdout.readline() == "ready\n"
    handle = prepare_transport(run_spec)
    try:
        assert handle.description == (
            f"joined the Zenoh router on tcp/localhost:{port}, which every user can use: programs behind it "
            "only watch"
        )
        robot = Robot(run_spec, opener, eventually)
        arguments = robot.arguments()
        arguments[0] = port
        report = read_report(program("other_user.py", second_user.uid, *arguments), robot.command)
        assert list(report.values()) == [{"heard": True, "saw": True, "answers": 0}] * 3
        assert robot.calls == []
        assert all(b"forged" not in bytes(sample.cdr) for sample in robot.got)
        # this user's own programs command although that router has the port
        mine = opener(run_spec.model_copy(update={"link_folder": ""})).create_node("mine")
        assert mine.call_service("/follower/stop", TRIGGER, b"\0\1\0\0\0", 20.0)
        assert len(robot.calls) == 1
        # and when it ends, this run takes its place, with the same rules
        foreign.kill()
        eventually(lambda: handle.hosting, what="the replacement")
        arguments[0] = ",".join(map(str, tcp_ports(os.getpid())))
        report = read_report(program("other_user.py", second_user.uid, *arguments), robot.command)
        assert list(report.values()) == [{"heard": True, "saw": True, "answers": 0}] * 6
        assert len(robot.calls) == 1
    finally:
        handle.close()


def test_a_survivor_hosts_with_the_rules_of_the_router_before(
    run_spec, opener, program, eventually, second_user
):
    first = program("router.py", run_spec.model_copy(update={"link_folder": ""}).model_dump_json())
    assert "hosts" in first.stdout.readline()
    # a file that is open joins a router that is not, and stays closed when it takes over
    open_spec = run_spec.model_copy(update={"open_to_local_users": True})
    handle = prepare_transport(open_spec)
    try:
        assert not handle.hosting
        robot = Robot(open_spec, opener, eventually)
        first.kill()
        eventually(lambda: handle.hosting, what="the replacement")
        report = read_report(program("other_user.py", second_user.uid, *robot.arguments()), robot.command)
        assert list(report.values()) == [{"heard": True, "saw": True, "answers": 0}] * 6
        assert robot.calls == []
    finally:
        handle.close()


def test_a_run_refuses_a_router_that_is_open_to_more_users_than_itself(zenoh_spec):
    handle = prepare_transport(zenoh_spec.model_copy(update={"open_to_local_users": True}))
    try:
        with pytest.raises(
            TransportError, match="takes commands from everyone who reaches it, and the transport"
        ):
            prepare_transport(zenoh_spec)
    finally:
        handle.close()


def test_this_users_programs_command_over_plain_tcp(run_spec, opener, program, eventually):
    """Such as ROS 2's tools, whose Zenoh has no UNIX sockets."""
    handle = prepare_transport(run_spec)
    try:
        robot = Robot(run_spec, opener, eventually)
        arguments = robot.arguments()
        report = read_report(program("other_user.py", 0, *arguments), robot.command)
        port = run_spec.listen_endpoints[0].rsplit(":", 1)[1]
        number = arguments[0].split(",").index(port)
        assert report[f"peer {number}"]["answers"]
        assert robot.calls
        assert any(b"forged by peer" in bytes(sample.cdr) for sample in robot.got)
    finally:
        handle.close()
