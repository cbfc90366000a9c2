"""Stepping and drawing through our wrappers, as ratios of bare MuJoCo in the same run."""

from __future__ import annotations

import argparse
import os
import statistics
import time
from collections.abc import Callable
from typing import Any

import gymnasium
import mujoco
import numpy as np
from joshua_mujoco_sim.envs import TASKS, TermVectorEnv
from joshua_mujoco_sim.model_file import load_model
from joshua_mujoco_sim.opengl import RenderingError, choose_gl
from joshua_mujoco_sim.physics import Physics
from joshua_mujoco_sim.rendering import CameraRenderer

SCENE = "so_arm100/scene.xml"


def rate_ratio(ours: Callable[[], None], bare: Callable[[], None], rounds: int) -> tuple[float, float, float]:
    """Median rates of both in calls per second, and the median of the rounds' ratios."""
    rows = []
    for _ in range(rounds):
        times = []
        for work in (bare, ours):
            start_s = time.perf_counter()
            work()
            times.append(time.perf_counter() - start_s)
        rows.append((1 / times[1], 1 / times[0], times[0] / times[1]))
    columns = list(zip(*rows, strict=True))
    return statistics.median(columns[0]), statistics.median(columns[1]), statistics.median(columns[2])


def show(name: str, ours: float, bare: float, ratio: float, unit: str, target: float | None) -> None:
    """Prints one line."""
    goal = "" if target is None else f"   target ≥ {target:g}: {'reached' if ratio >= target else 'missed'}"
    print(f"{name:<44} {ours:>10.0f} {unit}  bare {bare:>10.0f}  ratio {ratio:.2f}{goal}")


def stepping(rounds: int) -> None:
    """Physics.step against mj_step, in chunks of 1/60 s as an unpaced simulation runs."""
    physics, model = Physics(load_model(SCENE)), load_model(SCENE)
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key("home").id)
    calls, chunk = 300, 8

    def ours() -> None:
        for _ in range(calls):
            physics.step(chunk)

    def bare() -> None:
        for _ in range(calls * chunk):
            mujoco.mj_step(model, data)

    own, plain, ratio = rate_ratio(ours, bare, rounds)
    show(
        "Physics.step, so_arm100/scene.xml",
        own * calls * chunk,
        plain * calls * chunk,
        ratio,
        "steps/s",
        0.90,
    )


def environments(rounds: int) -> None:
    """Environment steps against mj_step with the same frame skip; many environments on one and two cores."""
    for name in TASKS:
        environment: Any = gymnasium.make(name, disable_env_checker=True).unwrapped
        environment.reset(seed=0)
        task = environment.task
        action = np.zeros(task.action_size)
        model = load_model(task.model_path)
        data = mujoco.MjData(model)
        mujoco.mj_resetDataKeyframe(model, data, model.key("home").id)
        calls = 300

        def ours(environment=environment, action=action, calls=calls) -> None:  # type: ignore[no-untyped-def]
            for _ in range(calls):
                environment.step(action)

        def bare(model=model, data=data, skip=task.frame_skip, calls=calls) -> None:  # type: ignore[no-untyped-def]
            for _ in range(calls):
                mujoco.mj_step(model, data, skip)

        own, plain, ratio = rate_ratio(ours, bare, rounds)
        show(name, own * calls, plain * calls, ratio, "env/s", 0.60)
        many(name, rounds)


def many(name: str, rounds: int) -> None:
    """64 environments at once, on two threads against one."""
    pair = [TermVectorEnv(TASKS[name], 64, threads=threads) for threads in (2, 1)]
    actions = np.zeros((64, pair[0].task.action_size))
    for one in pair:
        one.reset(seed=0)

    def work(one: TermVectorEnv) -> Callable[[], None]:
        def run() -> None:
            for _ in range(10):
                one.step(actions)

        return run

    own, plain, ratio = rate_ratio(work(pair[0]), work(pair[1]), rounds)
    show("  64 at once, two threads; bare: one thread", own * 640, plain * 640, ratio, "env/s", None)


def drawing(rounds: int) -> None:
    """CameraRenderer against mujoco.Renderer, 640 × 480."""
    try:
        os.environ["MUJOCO_GL"] = choose_gl()
    except RenderingError as error:
        print(f"drawing is left out: {error}")
        return
    model = load_model(SCENE)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    renderer = CameraRenderer(model, "top", 640, 480)
    plain_renderer = mujoco.Renderer(model, 480, 640)
    frames = 15

    def ours() -> None:
        for _ in range(frames):
            renderer.look(data)
            renderer.draw()

    def bare() -> None:
        for _ in range(frames):
            plain_renderer.update_scene(data, "top")
            plain_renderer.render()

    own, plain, ratio = rate_ratio(ours, bare, rounds)
    show("camera 640 × 480", own * frames, plain * frames, ratio, "frames/s", 0.85)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=9)
    arguments = parser.parse_args()
    print(f"load average {os.getloadavg()[0]:.1f}, {os.cpu_count()} cores")
    drawing(arguments.rounds)
    stepping(arguments.rounds)
    environments(arguments.rounds)
