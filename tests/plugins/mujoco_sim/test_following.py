"""What the model does on messages: MIRROR follows a robot, INTERACTIVE obeys commands; nonsense is named."""

from __future__ import annotations

import logging
import math

import numpy as np
import pytest
from joshua.messages.make import joint_state
from joshua.plan import NodeKind, NodeSpec
from joshua.testing.recording_context import RecordingContext
from joshua_mujoco_sim.following import Commands, Mirror
from joshua_mujoco_sim.settings_parts import TopicMapping
from joshua_mujoco_sim.world import World, WorldSettings


@pytest.fixture
def world() -> World:
    return World(WorldSettings("so_arm100/scene.xml", real_time_factor=0))


@pytest.fixture
def context() -> RecordingContext:
    spec = NodeSpec(name="simulation", kind=NodeKind.SERVICE, behaviour="a:B", implementation="a:B")
    return RecordingContext(spec)


def mapping(actuator: str, *, joint: str = "", scale: float = 1.0, offset: float = 0.0) -> TopicMapping:
    return TopicMapping(
        ros_topic="robot/joint_states", mujoco_actuator=actuator, joint=joint, scale=scale, offset=offset
    )


def position(world: World, joint: str) -> float:
    return float(world.physics.data.joint(joint).qpos[0])


def say(context: RecordingContext, topic: str, **joints: float) -> None:
    context.subscriptions[topic](joint_state(list(joints), np.array(list(joints.values()))), 0)


def test_twin_takes_joints_by_name_with_scale_and_offset(world: World, context: RecordingContext) -> None:
    mappings = [mapping("shoulder_pan"), mapping("gripper", joint="joint_6", scale=-0.5, offset=0.3)]
    twin = Mirror(world, mappings, context)
    twin.subscribe()
    assert list(context.subscriptions) == ["/robot/joint_states"]  # one subscription for both
    say(context, "/robot/joint_states", joint_6=0.4, other=9.0, shoulder_pan=0.7)
    with world.lock:
        world.advance(1)
    assert position(world, "shoulder_pan") == pytest.approx(0.7, abs=1e-3)
    assert position(world, "gripper") == pytest.approx(0.1, abs=1e-3)
    assert "1 messages, from arrival to state p50" in twin.report()
    twin.close()


def test_twin_names_what_it_cannot_follow_once(
    world: World, context: RecordingContext, caplog: pytest.LogCaptureFixture
) -> None:
    twin = Mirror(world, [mapping("shoulder_pan"), mapping("gripper")], context)
    twin.subscribe()
    start = position(world, "gripper")
    with caplog.at_level(logging.WARNING):
        for _ in range(3):
            say(context, "/robot/joint_states", shoulder_pan=math.nan, griper=0.4)
    assert [record.getMessage() for record in caplog.records] == [
        "robot/joint_states says nan for 'shoulder_pan'; the joint is not moved",
        "robot/joint_states has no joint 'gripper'; did you mean griper? it has shoulder_pan, griper; "
        "name the right one in mirror_topic_mappings.joint",
    ]
    with world.lock:
        world.advance(1)
    assert position(world, "gripper") == pytest.approx(start, abs=1e-3)
    twin.close()


def test_twin_follows_while_time_stands_still(world: World, context: RecordingContext) -> None:
    twin = Mirror(world, [mapping("shoulder_pan")], context)
    twin.subscribe()
    world.pause()
    say(context, "/robot/joint_states", shoulder_pan=0.5)
    assert position(world, "shoulder_pan") == pytest.approx(0.5)


def test_commands_move_the_joints_that_they_name(world: World, context: RecordingContext) -> None:
    commands = Commands(world, context)
    commands.subscribe()
    say(context, "~/joint_commands", shoulder_pan=0.5, gripper=99.0)
    with world.lock:
        world.advance(1500)
    assert position(world, "shoulder_pan") == pytest.approx(0.5, abs=0.02)
    assert position(world, "gripper") == pytest.approx(2.0, abs=0.05)  # the end of its range
    assert position(world, "elbow_flex") == pytest.approx(math.pi / 2, abs=0.1)  # nobody moved it
    commands.close()


def test_commands_outside_the_range_of_a_joint_are_named_once(
    world: World, context: RecordingContext, caplog: pytest.LogCaptureFixture
) -> None:
    commands = Commands(world, context)
    commands.subscribe()
    with caplog.at_level(logging.WARNING):
        for value in (99.0, 1e300):
            say(context, "~/joint_commands", gripper=value)
    (said,) = (record.getMessage() for record in caplog.records)
    assert said.startswith("~/joint_commands: a command for gripper is outside its range of ")
    assert said.endswith(" rad; the joint stays within its range")
    commands.close()


def test_commands_that_are_no_commands_are_named_once(
    world: World, context: RecordingContext, caplog: pytest.LogCaptureFixture
) -> None:
    commands = Commands(world, context)
    commands.subscribe()
    with caplog.at_level(logging.WARNING):
        for _ in range(3):
            say(context, "~/joint_commands", shoulder_pan=math.inf, griper=0.1)
    first, second = (record.getMessage() for record in caplog.records)
    assert first == "~/joint_commands: shoulder_pan is inf; a position is a finite number"
    assert second.startswith("~/joint_commands: no joint 'griper'; did you mean gripper? the model has ")
    with world.lock:
        world.advance(10)
    assert np.isfinite(world.physics.data.qpos).all()
    commands.close()
