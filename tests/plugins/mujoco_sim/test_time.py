"""Simulated time on /clock, in the stamps, and under the hand of the user."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from joshua.messages import decode
from joshua.plan import QosProfile, TransportSettings
from joshua.testing.domain import reserved_domain
from joshua.testing.port import free_port
from joshua.transport import open_transport
from sim_configs import simulation_file


class Simulation:
    """A running simulation, and what its topics say last."""

    def __init__(self, path: Path, domain: int, router: str) -> None:
        self.path = path
        (path.parent / "run").mkdir(mode=0o700)
        self.environment = os.environ | {
            "ROS_DOMAIN_ID": str(domain),
            "XDG_RUNTIME_DIR": str(path.parent / "run"),
        }
        self.process = subprocess.Popen(
            [sys.executable, "-m", "joshua.cli.main", "--config", str(path)],
            env=self.environment,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )
        self.newest: dict[str, Any] = {}
        self.times_s: list[float] = []
        self.transport: Any = None
        end = time.monotonic() + 60
        while self.transport is None:
            transport = open_transport(TransportSettings(domain_id=domain, listen_endpoints=(router,)))
            if transport.connected:
                self.transport = transport
            else:
                transport.close()
                assert self.process.poll() is None, self.process.communicate()[0]
                assert time.monotonic() < end
                time.sleep(0.2)
        node = self.transport.create_node("listener")
        for topic, kind in (
            ("/clock", "rosgraph_msgs/msg/Clock"),
            ("/simulation/joint_states", "sensor_msgs/msg/JointState"),
            ("/arm/joint_states", "sensor_msgs/msg/JointState"),
            ("/wheel", "sensor_msgs/msg/JointState"),
            ("/diagnostics", "diagnostic_msgs/msg/DiagnosticArray"),
        ):
            node.create_subscription(topic, kind, QosProfile(), self._take(topic, kind))

    def _take(self, topic: str, kind: str) -> Callable[[Any], None]:
        def take(sample: Any) -> None:
            message = decode(kind, sample.cdr)
            if topic == "/clock":
                self.times_s.append(float(message.clock.sec + message.clock.nanosec * 1e-9))
            self.newest[topic] = message

        return take

    def time_s(self) -> float:
        return self.times_s[-1]

    def command(self, *arguments: str, name: str = "sim") -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            [sys.executable, "-m", "joshua.cli.main", name, *arguments, "--timeout", "30"],
            env=self.environment,
            capture_output=True,
            text=True,
            timeout=60,
        )

    def wait(self, condition: Callable[[], Any], seconds: float = 60) -> None:
        end = time.monotonic() + seconds
        while not condition():
            assert time.monotonic() < end, self.newest.keys()
            time.sleep(0.02)

    def close(self) -> str:
        self.transport.close()
        self.process.terminate()
        return self.process.communicate(timeout=60)[0]


@pytest.fixture
def simulation(tmp_path: Path) -> Iterator[Simulation]:
    path = tmp_path / "robot.pbtxt"
    # an encoder that is no part of the model, in a process of its own
    encoder = """
  perceptions {
  node { node_name: "wheel" node_id: 9
    publishers { data_type: JOINT_STATE topic_name: "/wheel" publish_rate_hz: 20 } }
  perception_type: PERCEPTION_ENCODER mock_encoder_config { resolution: 100 } }
"""
    text = simulation_file(simulation="use_sim_time: true")
    router = f"tcp/localhost:{free_port()}"
    transport = f'transport {{ listen_endpoints: "{router}" }}'
    path.write_text(text.replace("robot {", "robot {" + encoder, 1) + transport)
    with reserved_domain() as domain:
        running = Simulation(path, domain, router)
        running.wait(lambda: len(running.newest) == 5)
        yield running
        text = running.close()
        assert "Traceback" not in text


@pytest.mark.timing
def test_stamps_are_simulated_time(simulation: Simulation) -> None:
    for topic in ("/arm/joint_states", "/simulation/joint_states", "/wheel", "/diagnostics"):

        def lag_s(topic: str = topic) -> float:
            stamp = simulation.newest[topic].header.stamp
            return abs(float(stamp.sec + stamp.nanosec * 1e-9) - simulation.time_s())

        simulation.wait(lambda: lag_s() < 2.0)

    def pace() -> float:
        """Simulated time against the clock; the machine may stand still in the midst of it."""
        before, begun_s = simulation.time_s(), time.monotonic()
        time.sleep(1.0)
        return (simulation.time_s() - before) / (time.monotonic() - begun_s)

    simulation.wait(lambda: 0.5 < pace() < 1.5)


def test_user_pauses_steps_sets_and_resets(simulation: Simulation) -> None:
    early = simulation.command("step")
    assert early.returncode == 1
    assert "the simulation is not paused; pause it first" in early.stderr
    paused = simulation.command("pause")
    assert paused.returncode == 0
    assert paused.stdout.startswith("paused at ")
    paused_s = float(paused.stdout.split()[2])
    simulation.wait(lambda: simulation.time_s() > paused_s - 0.015)  # the last one may still be on its way
    held = simulation.time_s()
    time.sleep(0.3)
    assert simulation.time_s() == held
    assert simulation.command("step", "50").returncode == 0
    simulation.wait(lambda: simulation.time_s() >= held + 0.09)
    time.sleep(0.2)
    assert simulation.time_s() == pytest.approx(held + 0.1, abs=0.011)
    assert simulation.command("set", "gripper=0.9").returncode == 0

    def gripper() -> float:
        message = simulation.newest["/simulation/joint_states"]
        return float(message.position[list(message.name).index("gripper")])

    simulation.wait(lambda: abs(gripper() - 0.9) < 0.01)
    typo = simulation.command("set", "griper=0.9")
    assert typo.returncode == 1
    assert "no joint griper; did you mean gripper?; joints are shoulder_pan, " in typo.stderr
    beyond = simulation.command("set", "shoulder_pan=5", "gripper=0.2")
    assert beyond.returncode == 1
    assert "shoulder_pan=5 is beyond its limits, -2.2 to 2.2 rad; nothing was set" in beyond.stderr
    assert abs(gripper() - 0.9) < 0.05
    assert simulation.command("reset").returncode == 0
    simulation.wait(lambda: abs(gripper()) < 0.01)
    known = len(simulation.times_s)
    assert simulation.command("resume").returncode == 0
    simulation.wait(lambda: any(0 < time_s < held for time_s in simulation.times_s[known:]))


def test_bad_requests_are_named(simulation: Simulation) -> None:
    refused = simulation.command("set", "gripper")
    assert refused.returncode == 2
    assert "expected JOINT=RADIANS, such as gripper=0.5" in refused.stderr
    missing = simulation.command("pause", "--node", "/other")
    assert missing.returncode == 1
    assert "no running system has a node /other" in missing.stderr
    none = simulation.command("step", "0")
    assert none.returncode == 1
    assert "count: Input should be greater than or equal to 1" in none.stderr
    endless = simulation.command("set", "gripper=nan")
    assert "joints: a number is not finite" in endless.stderr


def test_the_same_verbs_are_listed_and_called_like_those_of_any_node(simulation: Simulation) -> None:
    listed = simulation.command("simulation", name="call")
    assert listed.returncode == 0, listed.stderr
    assert "  pause  Pause simulated time." in listed.stdout
    assert (
        "  step [count:integer(1…30000)=1]  Advance by a number of steps while paused. (local only)"
        in listed.stdout
    )
    assert simulation.command("simulation", "pause", name="call").returncode == 0
    put = simulation.command("simulation", "set_state", "joints.gripper=0.4", name="call")
    assert (put.returncode, put.stdout) == (0, "set gripper\n"), put.stderr
    wrong = simulation.command("simulation", "step", "cuont=3", "count=many", name="call")
    assert wrong.returncode == 2
    assert "cuont: no such field; did you mean count? (count); count: Input should be a valid" in wrong.stderr
