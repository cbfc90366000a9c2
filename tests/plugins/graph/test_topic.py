"""``joshua topic`` against a running graph, in the process and as a real one."""

from __future__ import annotations

import re
import signal
import subprocess
import sys
import threading
import time

import numpy as np
import pytest
from joshua.cli.main import main
from joshua.messages import encode, make, message_class
from joshua.plan import QosProfile
from joshua.supervisor.tables import Screen
from joshua.testing.port import free_port
from joshua.testing.transport import transport_settings
from joshua.transport import open_transport, prepare_transport
from joshua_graph.graph import show

STRING = "std_msgs/msg/String"


@pytest.fixture(params=["zenoh", "dds"])
def graph(request, tmp_path, monkeypatch, joshua_domain_id):
    """A running graph with a node that publishes, and the options that reach it."""
    port, domain = free_port(), joshua_domain_id
    for name in ("RMW_IMPLEMENTATION", "AMENT_PREFIX_PATH", "ROS_AUTOMATIC_DISCOVERY_RANGE"):
        monkeypatch.delenv(name, raising=False)
    kind = request.param
    file = tmp_path / "robot.pbtxt"
    file.write_text(
        f'transport {{ kind: TRANSPORT_{kind.upper()} listen_endpoints: "tcp/localhost:{port}" }}'
        if kind == "zenoh"
        else "transport { kind: TRANSPORT_DDS }"
    )
    spec = transport_settings(kind, domain_id=domain, listen_endpoints=(f"tcp/localhost:{port}",))
    handle = prepare_transport(spec)
    transport = open_transport(spec)
    node = transport.create_node("talker", "/left")
    publisher = node.create_publisher("/left/words", STRING, QosProfile(depth=7))
    stop = threading.Event()
    node.said_s = said_s = []  # type: ignore[attr-defined]  # what the test counts

    def talk():
        while not stop.wait(0.02):
            said_s.append(time.monotonic())
            publisher.publish(encode(message_class(STRING)(f"word {len(said_s)}")))

    thread = threading.Thread(target=talk)
    thread.start()
    yield node, ["--config", str(file), "--wait", "60"]
    stop.set()
    thread.join()
    transport.close()
    if handle is not None:
        handle.close()


def test_list(graph, capsys):
    _, options = graph
    assert main(["topic", "list", "-t", *options]) == 0
    assert capsys.readouterr().out == f"/left/words  {STRING}\n"


def test_info(graph, capsys):
    _, options = graph
    assert main(["topic", "info", "left/words", *options]) == 0
    assert capsys.readouterr().out.splitlines() == [
        "/left/words",
        f"type: {STRING}",
        "hash: RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18",
        "publishers: 1",
        "  /left/talker  RELIABLE, VOLATILE, KEEP_LAST 7",
        "subscriptions: 0",
    ]


def test_echo_prints_messages_as_yaml(graph, capsys):
    _, options = graph
    assert main(["topic", "echo", "/left/words", "-n", "2", *options]) == 0
    first, second, rest = capsys.readouterr().out.split("---\n")
    assert first.startswith("data: word ")
    assert second.startswith("data: word ")
    assert rest == ""


def test_a_terminal_gets_long_lines_wrapped_between_values(monkeypatch, capsys):
    monkeypatch.setattr(Screen, "of", lambda stream: Screen(40))
    show(["header:", f"position: [{', '.join(['0.123456'] * 5)}]"])
    assert capsys.readouterr().out.splitlines() == [
        "header:",
        "position: [0.123456, 0.123456, 0.123456,",
        "    0.123456, 0.123456]",
    ]


def test_echo_gets_what_a_publisher_keeps(graph, capsys):
    node, options = graph
    kept = node.create_publisher(
        "/left/scan", "sensor_msgs/msg/JointState", QosProfile(durability="TRANSIENT_LOCAL", depth=1)
    )
    kept.publish(encode(make.joint_state([f"j{n}" for n in range(20)], np.arange(20.0), at_ns=1_500_000_000)))
    assert main(["topic", "echo", "/left/scan", "--once", *options]) == 0
    out = capsys.readouterr().out
    assert out == (
        "header:\n  stamp:\n    sec: 1\n    nanosec: 500000000\n  frame_id: \"\"\n"
        "name: [j0, j1, j2, j3, j4, j5, j6, j7, j8, j9, j10, j11, …]  # 20 values\n"
        "position: [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0, 10.0, 11.0, …]  # 20 values\n"
        "velocity: []\neffort: []\n---\n"
    )  # fmt: skip
    assert main(["topic", "echo", "/left/scan", "--once", "--full", *options]) == 0
    assert "18.0, 19.0]\n" in capsys.readouterr().out


def test_echo_ends_when_nothing_comes(graph, capsys):
    node, options = graph
    silent = node.create_publisher("/left/silent", STRING, QosProfile())
    echo = ["topic", "echo", "/left/silent", "--once", "--timeout", "0.5", *options]
    assert main(echo) == 1
    text = "no message received on /left/silent within 0.5 s: its 1 publisher sent none. Wait longer"
    assert text in capsys.readouterr().err
    silent.close()
    assert main([*echo[:2], "/left/nobody", "--type", STRING, *echo[3:]]) == 1
    assert "within 0.5 s: it has no publisher. Wait longer with --timeout" in capsys.readouterr().err


def test_echo_says_when_the_last_publisher_leaves_and_comes_back(graph, capsys):
    node, options = graph
    out, err = sys.stdout, sys.stderr  # those of capsys, which can be looked at meanwhile

    def say(word, publisher):
        until(lambda: publisher.subscription_count)
        publisher.publish(encode(message_class(STRING)(word)))

    def leave_and_come_back(publisher):
        say("here", publisher)
        until(lambda: "data: here" in out.getvalue())
        publisher.close()
        until(lambda: "has left" in err.getvalue())
        publisher = node.create_publisher("/left/brief", STRING, QosProfile())
        until(lambda: "again" in err.getvalue())
        say("back", publisher)

    first = node.create_publisher("/left/brief", STRING, QosProfile())
    thread = threading.Thread(target=leave_and_come_back, args=(first,))
    thread.start()
    echo = ["topic", "echo", "/left/brief", "-n", "2", "--timeout", "60"]
    assert main([*echo, *options]) == 0
    thread.join()
    captured = capsys.readouterr()
    assert captured.out == "data: here\n---\ndata: back\n---\n"
    assert captured.err.splitlines() == [
        "the last publisher of /left/brief has left; waiting for another (Ctrl-C ends)",
        "/left/brief has a publisher again",
    ]


def until(condition):
    end_s = time.monotonic() + 60
    while not condition():
        assert time.monotonic() < end_s
        time.sleep(0.01)


def test_hz_prints_the_rate(graph, capsys):
    node, options = graph
    assert main(["topic", "hz", "/left/words", "-n", "1", *options]) == 0
    said_s = list(node.said_s)
    rate_hz, count = re.fullmatch(
        r"([\d.]+) Hz  period .* ms  deviation .* ms  messages (\d+)\n", capsys.readouterr().out
    ).groups()
    # a machine that is busy lets the talker speak more slowly: so often did it speak that many times
    rates_hz = [
        (int(count) - 1) / (later_s - sooner_s)
        for sooner_s, later_s in zip(said_s, said_s[int(count) - 1 :], strict=False)
    ]
    assert min(rates_hz) / 2 < float(rate_hz) < max(rates_hz) * 2
    assert max(rates_hz) <= 60


def test_pub_reaches_a_subscription(graph, capsys):
    node, options = graph
    got = []
    node.create_subscription("/left/command", "sensor_msgs/msg/JointState", QosProfile(), got.append)
    values = "{header: {frame_id: base}, name: [a, b], position: [1, 2.5]}"
    assert main(["topic", "pub", "/left/command", "JOINT_STATE", values, "--once", *options]) == 0
    assert capsys.readouterr().out == "published sensor_msgs/msg/JointState on /left/command: 1\n"
    until(lambda: got)


def test_pub_with_a_count_waits_for_a_subscription(graph, capsys):
    node, options = graph
    received = []

    def subscribe():
        time.sleep(0.5)
        node.create_subscription("/left/late", STRING, QosProfile(), received.append)

    thread = threading.Thread(target=subscribe)
    thread.start()
    assert main(["topic", "pub", "/left/late", STRING, "-n", "5", "--rate", "50", *options]) == 0
    thread.join()
    assert capsys.readouterr().out.splitlines()[-1] == f"published {STRING} on /left/late: 5"
    until(lambda: len(received) == 5)


@pytest.mark.parametrize("pace", [["--once"], ["--count", "3"]])
def test_pub_says_that_it_has_no_subscription(graph, capsys, pace):
    _, options = graph
    assert main(["topic", "pub", "/nobody", STRING, *pace, *options[:2], "--wait", "1"]) == 1
    assert "/nobody had no subscription within 1 s, so nothing was published" in capsys.readouterr().err


@pytest.mark.parametrize("action", ["info", "echo", "hz"])
def test_an_unknown_topic_names_the_nearest(graph, capsys, action):
    _, options = graph
    assert main(["topic", action, "/left/world", *options[:2], "--wait", "1.5"]) == 2
    error = capsys.readouterr().err
    assert "no topic /left/world appeared within 1.5 s; the nearest are /left/words" in error


def test_the_end_by_the_user_is_quiet(graph):
    _, options = graph
    command = [sys.executable, "-m", "joshua.cli.main", "topic", "echo", "/left/words", *options]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    assert process.stdout.readline().startswith("data: word")
    process.send_signal(signal.SIGINT)
    _, error = process.communicate(timeout=60)
    assert process.returncode == 0
    assert error == ""


def test_a_closed_pipe_ends_it_quietly(graph):
    _, options = graph
    command = [sys.executable, "-m", "joshua.cli.main", "topic", "echo", "/left/words", *options]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    process.stdout.readline()
    process.stdout.close()
    assert process.stderr.read() == ""
    process.stderr.close()
    assert process.wait(60) == 0


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (["/x", "Sring"], "the nearest are std_msgs/msg/String"),
        (["/x", "std_msgs/msg/Sring"], "the nearest are std_msgs/msg/String"),
        (["/x", "STRING", "{dta: a}"], "it has data; did you mean data?"),
        (["/x", "STRING", "{data: 3}"], "data: found 3; it takes a text"),
        (["/x", "STRING", "{data: a"], "line 1, column 9"),
        (["/x", "STRING", "[" * 5000], "the values cannot be read"),
        (["/x", "POINT", "{x: true}"], "x: found True; it takes a number"),
        (["/x", "UINT8", "{data: 256}"], "a whole number from 0 to 255"),
        (["/x", "POSE", "{position: {z: high}}"], "position.z: found 'high'"),
    ],
)
def test_wrong_types_and_values_are_refused_before_anything_is_opened(capsys, arguments, text):
    assert main(["topic", "pub", *arguments]) == 2
    assert text in capsys.readouterr().err


def test_no_router_is_said_with_what_to_do(tmp_path, capsys, monkeypatch):
    monkeypatch.delenv("RMW_IMPLEMENTATION", raising=False)
    port = free_port()
    file = tmp_path / "robot.pbtxt"
    file.write_text(f'transport {{ kind: TRANSPORT_ZENOH listen_endpoints: "tcp/localhost:{port}" }}')
    assert main(["topic", "list", "--config", str(file), "--wait", "0.3"]) == 1
    error = capsys.readouterr().err
    assert f"no Zenoh router answers on tcp/localhost:{port}" in error
    assert "Start a robot" in error


def test_an_empty_domain_is_said(joshua_domain_id, capsys):
    assert main(["topic", "list", "--transport", "dds", "--wait", "0.3"]) == 0
    captured = capsys.readouterr()
    assert captured.out == ""
    assert "no ROS 2 node was found on DDS domain" in captured.err


@pytest.mark.parametrize(
    ("name", "value", "text"),
    [
        ("ROS_DOMAIN_ID", "300", "whole numbers from 0 to 232"),
        ("RMW_IMPLEMENTATION", "rmw_zenho_cpp", "allowed are rmw_zenoh_cpp"),
    ],
)
def test_a_wrong_environment_is_refused(monkeypatch, capsys, name, value, text):
    monkeypatch.setenv(name, value)
    assert main(["topic", "list"]) == 2
    assert text in capsys.readouterr().err


def test_a_missing_file_is_refused(capsys):
    assert main(["topic", "list", "--config", "/nosuch/robot.pbtxt"]) == 2
    assert "/nosuch/robot.pbtxt" in capsys.readouterr().err


@pytest.mark.parametrize(
    "arguments",
    [
        ["ech"],
        ["echo"],
        ["echo", "/x", "-n", "0"],
        ["pub", "/x", "STRING", "--rate", "0"],
        ["hz", "/x", "--wait", "-1"],
    ],
)
def test_invalid_command_lines_end_with_2(arguments, capsys):
    with pytest.raises(SystemExit) as ended:
        main(["topic", *arguments])
    assert ended.value.code == 2
    assert "joshua topic" in capsys.readouterr().err
