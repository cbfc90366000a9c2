"""The stepping thread, its clock, and the world that nodes of one process share."""

from __future__ import annotations

import threading
import time

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from joshua_mujoco_sim.world import LARGEST_LAG_S, Pacer, World, WorldSettings, leave_world, shared_world

SCENE = WorldSettings("so_arm100/scene.xml")


@given(
    st.lists(st.floats(0, LARGEST_LAG_S * 0.9), min_size=1, max_size=50),
    st.sampled_from([0.5, 1.0, 2.0]),
    st.sampled_from([0.001, 0.002, 0.004]),
)
def test_pacer_never_drifts(naps_s: list[float], factor: float, timestep_s: float) -> None:
    now_s = 0.0
    pacer = Pacer(timestep_s, factor, clock=lambda: now_s)
    steps = 0
    for nap_s in naps_s:
        now_s += nap_s
        steps += pacer.due()
        assert 0 <= now_s * factor - steps * timestep_s < timestep_s + 1e-6
    assert pacer.dropped_s == 0


def test_pacer_gives_up_a_stall_and_says_how_much() -> None:
    now_s = 0.0
    pacer = Pacer(0.002, clock=lambda: now_s)
    now_s = 5.0
    assert pacer.due() == round(LARGEST_LAG_S / 0.002)
    assert pacer.dropped_s == pytest.approx(5.0 - LARGEST_LAG_S)
    assert pacer.due() == 0


def _wait(condition, seconds: float = 60) -> None:
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.005)


def test_runs_pauses_steps_and_resets() -> None:
    world = World(SCENE)
    try:
        world.start()
        _wait(lambda: world.physics.time_s > 0.05)
        world.pause()
        before = world.physics.time_s
        time.sleep(0.05)
        assert world.physics.time_s == before
        world.step_paused(10)
        after = pytest.approx(before + 10 * world.physics.timestep_s)
        _wait(lambda: world.physics.time_s == after)
        time.sleep(0.03)
        assert world.physics.time_s == after
        world.reset()
        assert world.physics.time_s == 0
        world.resume()
        _wait(lambda: world.physics.time_s > 0)
    finally:
        world.close()


def test_no_step_is_done_after_a_pause() -> None:
    """What was due already when time stopped, on a thread that is late, is given up."""
    world = World(SCENE)
    try:
        world.start()
        _wait(lambda: world.physics.time_s > 0)
        for _ in range(20):
            with world.lock:
                time.sleep(0.02)  # the thread has steps to do and waits for the lock
                world.pause()
                before = world.physics.time_s
            time.sleep(0.01)
            assert world.physics.time_s == before
            world.resume()
    finally:
        world.close()


def test_hooks_run_around_each_step_and_can_be_removed() -> None:
    world = World(SCENE)
    times: list[float] = []
    remove = world.after_step(lambda physics: times.append(physics.time_s))
    try:
        world.start()
        _wait(lambda: len(times) > 20)
        remove()
        count = len(times)
        assert np.diff(times) == pytest.approx(world.physics.timestep_s)
        time.sleep(0.05)
        assert len(times) == count
    finally:
        world.close()


@pytest.mark.parametrize("resets", [True, False])
def test_divergence_follows_the_policy(resets: bool) -> None:
    world = World(WorldSettings("so_arm100/scene.xml", reset_on_divergence=resets))
    try:
        with world.lock:
            world.physics.data.qvel[1] = np.inf
        world.start()
        _wait(lambda: bool(world.divergences))
        assert "diverged" in world.divergences[0]
        if resets:
            _wait(lambda: world.physics.time_s > 0.05)
            assert not world.failure
        else:
            _wait(lambda: bool(world.failure))
            assert "diverged" in world.failure
    finally:
        world.close()


def test_physics_waits_for_a_deferred_job_and_devices_do_not() -> None:
    world = World(SCENE)
    begun, end = threading.Event(), threading.Event()

    def draw() -> None:
        begun.set()
        end.wait(60)

    try:
        world.start()
        _wait(lambda: world.physics.time_s > 0)
        world.defer(draw)
        assert begun.wait(60)
        with world.lock:  # a device reads meanwhile
            held_s = world.physics.time_s
        time.sleep(0.05)
        assert world.physics.time_s == held_s
        end.set()
        _wait(lambda: world.physics.time_s > held_s)
        done: list[int] = []
        world.call(lambda: done.append(threading.get_ident()))
        assert done
        assert done[0] != threading.get_ident()
    finally:
        end.set()
        world.close()


def test_nodes_of_a_process_share_one_world() -> None:
    first, second = shared_world(SCENE), shared_world(SCENE)
    assert first is second
    first.start()
    leave_world(first)
    _wait(lambda: second.physics.time_s > 0.01)
    leave_world(second)
    stopped = second.physics.time_s
    time.sleep(0.03)
    assert second.physics.time_s == stopped
    third = shared_world(SCENE)
    assert third is not first
    leave_world(third)
