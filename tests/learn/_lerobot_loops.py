"""LeRobot's own loops on an emulated arm, as its commands run them, and its policy alone.

Run by ``bench_loops.py``: ``sync`` is the loop of ``lerobot-record`` with a policy, ``server`` and ``client``
are its asynchronous inference, ``alone`` calls the policy and nothing else. What is added here only takes the
time. Each but the server prints its figures as JSON at the end: ``ticks``, when an action was handed to the
arm, and ``chunks`` as ``_loop_times.py`` writes them.
"""

from __future__ import annotations

import json
import sys
import threading
import time
import types
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import torch
from _loop_times import noted_network
from lerobot.cameras.camera import Camera
from lerobot.configs.policies import PreTrainedConfig
from lerobot.policies.act.modeling_act import ACTPolicy
from lerobot.policies.factory import make_pre_post_processors
from lerobot.robots.so_follower import SO100Follower, SO100FollowerConfig

torch.set_num_threads(1)
Chunk = tuple[float, float, float, float]


class Picture(Camera):  # type: ignore[misc]
    """A camera whose newest picture is always there, and costs nothing."""

    def __init__(self, height: int, width: int) -> None:
        self.fps, self.height, self.width = 30, height, width
        self._picture = np.random.default_rng(0).integers(0, 255, (height, width, 3), np.uint8)

    is_connected = True
    connect = disconnect = lambda self, *_, **__: None

    @staticmethod
    def find_cameras() -> list[Any]:
        return []

    def read(self) -> Any:
        return self._picture

    def async_read(self, timeout_ms: float = 0.0) -> Any:
        return self._picture

    def read_latest(self, max_age_ms: int = 0) -> Any:
        return self._picture


class Follower(SO100Follower):  # type: ignore[misc]
    """LeRobot's arm, with the camera; remembers when it was read last, and when it was handed actions."""

    def __init__(self, port: str, calibration: Path, checkpoint: str) -> None:
        super().__init__(
            SO100FollowerConfig(port=port, id="arm", calibration_dir=calibration, use_degrees=False)
        )
        features = PreTrainedConfig.from_pretrained(checkpoint).image_features
        self.cameras = {"top": Picture(*features["observation.images.top"].shape[1:])}
        # One late reply would end LeRobot's loop: on a busy machine it asks again.
        self.bus.sync_read = partial(self.bus.sync_read, num_retry=5)
        self.read_s = 0.0
        self.ticks: list[float] = []

    @property
    def _cameras_ft(self) -> dict[str, tuple[int, int, int]]:
        return {name: (camera.height, camera.width, 3) for name, camera in self.cameras.items()}

    def get_observation(self) -> Any:
        found = super().get_observation()
        self.read_s = time.monotonic()
        return found

    def send_action(self, action: Any) -> Any:
        self.ticks.append(time.monotonic())
        return super().send_action(action)


def alone(checkpoint: str, seconds: str) -> None:
    """A chunk after the other, of an observation that is there already."""
    from lerobot.policies.utils import prepare_observation_for_inference

    policy = ACTPolicy.from_pretrained(checkpoint)
    before, after = make_pre_post_processors(policy.config, pretrained_path=checkpoint)
    shape = policy.config.image_features["observation.images.top"].shape[1:]
    seen = {
        "observation.images.top": Picture(*shape).read(),
        "observation.state": np.zeros(6, np.float32),
    }
    took_s: list[float] = []
    noted_network(took_s)
    chunks: list[Chunk] = []
    ends_s = time.monotonic() + float(seconds)
    while time.monotonic() < ends_s:
        began_s = time.monotonic()
        with torch.inference_mode():
            after(
                policy.predict_action_chunk(
                    before(prepare_observation_for_inference(dict(seen), torch.device("cpu")))
                )
            )
        chunks.append((began_s, began_s, took_s[-1], time.monotonic()))
    report([], chunks[2:])


def sync(port: str, calibration: str, checkpoint: str, rate_hz: str, seconds: str) -> None:
    """The loop of ``lerobot-record``: observe, select an action, send it, wait."""
    sys.modules.setdefault("rerun", types.ModuleType("rerun"))  # imported for a window that stays closed
    from lerobot.datasets.utils import hw_to_dataset_features
    from lerobot.processor import make_default_processors
    from lerobot.scripts.lerobot_record import record_loop

    policy = ACTPolicy.from_pretrained(checkpoint)
    before, after = make_pre_post_processors(policy.config, pretrained_path=checkpoint)
    robot = Follower(port, Path(calibration), checkpoint)
    robot.connect()
    teleop_step, robot_step, seen_step = make_default_processors()
    features = {
        **hw_to_dataset_features(robot.action_features, "action", use_video=False),
        **hw_to_dataset_features(robot.observation_features, "observation", use_video=False),
    }
    took_s: list[float] = []
    noted_network(took_s)
    chunks: list[Chunk] = []
    send = robot.send_action

    def noted(action: Any) -> Any:
        sent = send(action)
        if len(took_s) > len(chunks):
            chunks.append((robot.read_s, robot.read_s, took_s[-1], robot.ticks[-1]))
        return sent

    robot.send_action = noted  # type: ignore[method-assign]
    record_loop(
        robot=robot,
        events={"exit_early": False},
        fps=int(float(rate_hz)),
        teleop_action_processor=teleop_step,
        robot_action_processor=robot_step,
        robot_observation_processor=seen_step,
        dataset=types.SimpleNamespace(
            fps=int(float(rate_hz)), features=features, add_frame=lambda frame: None, image_writer=None
        ),
        policy=policy,
        preprocessor=before,
        postprocessor=after,
        control_time_s=float(seconds),
        single_task="",
    )
    robot.disconnect()
    report(robot.ticks, chunks)


def server(port: str, rate_hz: str, times: str) -> None:
    """The policy server; writes the network's time of each chunk, and when it ended, into a file."""
    from lerobot.async_inference.policy_server import PolicyServer, serve

    took_s: list[float] = []
    noted_network(took_s)
    get = PolicyServer._get_action_chunk

    def noted(self: Any, observation: Any) -> Any:
        chunk = get(self, observation)
        with Path(times).open("a") as file:
            file.write(f"{time.monotonic()} {took_s[-1]}\n")
        return chunk

    PolicyServer._get_action_chunk = noted
    sys.argv = ["policy_server", "--host=127.0.0.1", f"--port={port}", f"--fps={int(float(rate_hz))}"]
    serve()


def client(
    port: str, calibration: str, checkpoint: str, rate_hz: str, seconds: str, address: str, times: str
) -> None:
    """The robot client: streams observations, plays the newest chunk; all settings at their defaults."""
    from lerobot.async_inference import robot_client
    from lerobot.async_inference.configs import RobotClientConfig

    robot = Follower(port, Path(calibration), checkpoint)

    def this(_: Any) -> Follower:
        return robot

    robot_client.make_robot_from_config = this
    made = robot_client.RobotClient(
        RobotClientConfig(
            policy_type="act",
            pretrained_name_or_path=checkpoint,
            robot=robot.config,
            actions_per_chunk=PreTrainedConfig.from_pretrained(checkpoint).chunk_size,
            server_address=address,
            fps=int(float(rate_hz)),
        )
    )
    arrivals: list[tuple[float, float]] = []  # of the observation, of the chunk
    aggregate = made._aggregate_action_queues

    def aggregated(incoming: Any, *rest: Any) -> None:
        aggregate(incoming, *rest)
        queued_s = time.monotonic()
        arrivals.append((incoming[0].get_timestamp() - time.time() + time.monotonic(), queued_s))

    made._aggregate_action_queues = aggregated
    if not made.start():
        sys.exit("the policy server cannot be reached")
    threading.Thread(target=made.receive_actions, daemon=True).start()
    threading.Timer(float(seconds), made.shutdown_event.set).start()
    made.control_loop(task="")
    made.robot.disconnect()
    computed = [tuple(map(float, line.split())) for line in Path(times).read_text().splitlines()]
    chunks = []
    for observed_s, queued_s in arrivals:
        took_s = [took_s for ended_s, took_s in computed if observed_s < ended_s < queued_s]
        chunks.append((observed_s, observed_s, took_s[-1], queued_s))
    report(robot.ticks, chunks)


def report(ticks: list[float], chunks: list[Chunk]) -> None:
    """Prints what was noted."""
    print(json.dumps({"ticks": ticks, "chunks": chunks}), flush=True)


LOOPS: dict[str, Callable[..., None]] = {"alone": alone, "sync": sync, "server": server, "client": client}

if __name__ == "__main__":
    LOOPS[sys.argv[1]](*sys.argv[2:])
