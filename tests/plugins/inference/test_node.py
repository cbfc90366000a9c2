"""The node of a model.

Why one file: its tests share a scripted model and a stepped clock.
"""

from __future__ import annotations

import sys
import threading
import time
import types
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest
from joshua.features import Feature
from joshua.messages import message_class
from joshua.messages.arrays import load_decoder
from joshua.messages.make import joint_state
from joshua.models.model import Model, ModelError, Observation
from joshua.node.verbs import RefusedError, verbs_of
from joshua.plan import JointRange, ModelNeeds, NodeKind, NodeSpec, TopicSpec
from joshua.schema import config_pb2
from joshua.testing.recording_context import RecordingContext
from joshua_inference.node import EpisodeEnd, InferenceNode, TaskRequest, Weights
from joshua_inference.random_noise_settings import RandomNoiseSettings

JOINTS = [JointRange("a", -1.0, 1.0), JointRange("b", -0.1, 0.1)]
ACTION = TopicSpec(name="/action", type_name="sensor_msgs/msg/JointState", rate_hz=50.0)
SEEN = TopicSpec(name="/seen", type_name="std_msgs/msg/Int64")
PERIOD_NS = 20_000_000
COUNTED = [Feature("observation.seen", "int64", (1,), topic="/seen")]
FACTS = {
    "joints": JOINTS,
    "features": COUNTED,
    "task": "pick it up",
    "execution": {"observation_max_age_s": 3600.0},
}


def wait_until(condition: Callable[[], bool]) -> None:
    deadline = time.monotonic() + 30
    while not condition():
        assert time.monotonic() < deadline, "the condition did not come true in 30 s"
        time.sleep(0.002)


class ScriptedModel(Model):
    """Returns what the test puts into ``chunk``; keeps what it was shown."""

    chunk: Any = np.zeros((1, 2))
    seen: list[Observation]
    calls: list[str]
    gate: threading.Event

    def load(self) -> None:
        self.calls.append("load")

    def reset(self) -> None:
        self.calls.append("reset")

    def act(self, observation: Observation) -> Any:
        self.gate.wait(30)
        self.seen.append(observation)
        return type(self).chunk

    def close(self) -> None:
        self.calls.append("close")


@pytest.fixture
def model(monkeypatch: pytest.MonkeyPatch) -> Iterator[Any]:
    module = types.ModuleType("joshua_scripted_model")
    gate = threading.Event()
    gate.set()
    one = type("OneModel", (ScriptedModel,), {"seen": [], "calls": [], "gate": gate})
    module.OneModel = one  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, module.__name__, module)
    yield one
    gate.set()


def spec(**fields: Any) -> NodeSpec:
    return NodeSpec(
        **{
            "name": "policy",
            "kind": NodeKind.MODEL,
            "behaviour": "",
            "implementation": "joshua_scripted_model:OneModel",
            "facts": FACTS,
            "publishers": (ACTION,),
            "subscriptions": (SEEN,),
            **fields,
        }
    )


class SteppedContext(RecordingContext):
    """Its clock moves by one period with each tick of the actions."""

    def __init__(self, node_spec: NodeSpec) -> None:
        super().__init__(node_spec)
        self.clock_ns = time.time_ns()

    def now_ns(self) -> int:
        return self.clock_ns

    def tick(self, name: str, times: int = 1) -> None:
        for _ in range(times):
            super().tick(name)
            self.clock_ns += PERIOD_NS


def configured(node_spec: NodeSpec) -> tuple[SteppedContext, InferenceNode]:
    context = SteppedContext(node_spec)
    node = InferenceNode(context)
    node.configure()
    return context, node


def start(node_spec: NodeSpec) -> tuple[SteppedContext, InferenceNode]:
    context, node = configured(node_spec)
    node.activate()
    return context, node


def end(context: RecordingContext, node: InferenceNode) -> None:
    for _ in range(2):
        node.deactivate()
        context.stop()
        node.cleanup()


def actions(context: RecordingContext) -> list[list[float]]:
    return [message.position.tolist() for message in context.publishers["/action"].messages]


def see(context: RecordingContext, number: int) -> None:
    context.receive("/seen", message_class("std_msgs/msg/Int64")(number))


def play_until(context: RecordingContext, count: int, *, seen: int | None = None) -> None:
    """Lets time pass until so many actions were played; something is seen again and again meanwhile."""

    def enough() -> bool:
        if seen is not None:
            see(context, seen)
        context.tick("actions")
        time.sleep(0.002)  # for the model's thread
        return len(actions(context)) >= count

    wait_until(enough)


def play(context: SteppedContext, node: InferenceNode, count: int) -> None:
    """Lets so many periods pass, each with an observation, and each after the model has answered."""
    for _ in range(count):
        see(context, 1)
        wait_until(lambda: not node._loop._wants())
        context.tick("actions")


def test_observations_become_actions_at_the_publishers_rate(model: Any) -> None:
    model.chunk = np.array([[0.1, 0.0], [0.2, 0.05], [0.3, 0.0], [0.4, 0.05]])
    context, node = configured(spec())
    see(context, 1)
    see(context, 2)
    node.activate()
    assert context.timers["actions"][0] == 1 / 50
    wait_until(lambda: bool(model.seen))
    play(context, node, 4)
    end(context, node)
    assert actions(context)[:4] == [[0.1, 0.0], [0.2, 0.05], [0.1, 0.0], [0.2, 0.05]]
    observation = model.seen[0]
    assert observation["observation.seen"].tolist() == [2], "the newest"
    assert observation.task == "pick it up"
    assert abs(observation.stamp_ns - time.time_ns()) < 60e9
    message = context.publishers["/action"].messages[0]
    assert message.name == ["a", "b"]
    assert model.calls == ["load", "reset", "close", "close"]


def test_steps_whose_time_has_passed_are_skipped(model: Any, caplog: pytest.LogCaptureFixture) -> None:
    model.chunk = np.array([[0.1, 0.0], [0.2, 0.0], [0.3, 0.0], [0.4, 0.0]])
    context, node = configured(spec())
    see(context, 1)
    model.gate.clear()
    node.activate()
    context.tick("actions", 3)  # the model computes for three periods
    model.gate.set()
    wait_until(lambda: bool(node.figures().chunks))
    context.tick("actions")
    assert actions(context) == [[0.4, 0.0]]
    assert node.figures().skipped == 3
    model.gate.clear()
    see(context, 1)
    context.tick("actions", 9)
    model.gate.set()
    wait_until(lambda: "every step of a chunk was late" in caplog.text)
    end(context, node)


def test_nothing_is_published_before_everything_was_observed(
    model: Any, caplog: pytest.LogCaptureFixture
) -> None:
    context, node = start(spec())
    wait_until(lambda: bool(caplog.messages))
    context.tick("actions", 5)
    assert actions(context) == []
    assert model.seen == []
    assert caplog.messages == ["waiting for a message on /seen"]
    see(context, 1)
    play_until(context, 1)
    end(context, node)


def test_what_was_planned_on_stale_observations_is_dropped(model: Any) -> None:
    model.chunk = np.full((1000, 2), 0.05)
    context, node = start(
        spec(facts={"joints": JOINTS, "features": COUNTED, "execution": {"observation_max_age_s": 0.3}})
    )
    play_until(context, 1, seen=1)
    time.sleep(0.35)
    context.tick("actions", 15)  # the ramp of 0.3 s into a hold
    count = len(actions(context))
    context.tick("actions", 20)
    assert len(actions(context)) == count
    play_until(context, count + 1, seen=2)
    end(context, node)


def test_a_slow_model_does_not_stop_the_timer(model: Any) -> None:
    context, node = start(spec())
    see(context, 1)
    play_until(context, 1)
    model.gate.clear()
    before = time.monotonic()
    while context.tick("actions") or node.figures().gaps < 5:  # the timer finds nothing to play, and returns
        assert time.monotonic() - before < 30
    model.gate.set()
    see(context, 2)
    play_until(context, len(actions(context)) + 1)
    end(context, node)
    rows = {check: passed for check, passed, _ in node.test_results()}
    assert not rows["model keeps up"]
    assert rows["observations on /seen"]


def test_actions_are_clipped_to_the_limits(model: Any, caplog: pytest.LogCaptureFixture) -> None:
    model.chunk = np.array([[5.0, -5.0]])
    context, node = start(spec(subscriptions=(), facts={"joints": JOINTS}))
    play_until(context, 10)
    end(context, node)
    assert actions(context)[0] == [1.0, -0.1]
    assert caplog.text.count("the model commands b to -5 rad, its limits are -0.1 to 0.1 rad") == 1


@pytest.mark.parametrize(
    ("chunk", "message"),
    [
        (np.zeros((1, 3)), r"OneModel\.act returned shape \(1, 3\); 2 joints need \(T, 2\), T ≥ 1"),
        (np.zeros(2), r"OneModel\.act returned shape \(2,\)"),
        (np.zeros((0, 2)), r"OneModel\.act returned shape \(0, 2\)"),
        (np.array([[0.0, np.nan]]), r"OneModel\.act returned a value that is not finite"),
    ],
)
def test_actions_that_cannot_be_sent_fail_the_node(model: Any, chunk: Any, message: str) -> None:
    model.chunk = chunk
    context, node = start(spec(subscriptions=(), facts={"joints": JOINTS}))
    wait_until(lambda: not any(thread.is_alive() for thread in context._threads))
    context.tick("actions", 3)
    with pytest.raises(ModelError, match=message):
        context.stop()
    node.cleanup()
    assert actions(context) == []


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"facts": {}}, "/policy has no known joints: let an actuator subscribe to /action"),
        ({"publishers": ()}, "/policy publishes no action: add a publisher of type JOINT_STATE"),
        (
            {"publishers": (TopicSpec(name="/x", type_name="sensor_msgs/msg/Imu", rate_hz=1.0),)},
            "/policy cannot publish sensor_msgs/msg/Imu on /x",
        ),
        (
            {"subscriptions": (TopicSpec(name="/text", type_name="std_msgs/msg/String"),)},
            "/policy cannot observe std_msgs/msg/String on /text: it contains no numbers",
        ),
    ],
)
def test_a_model_that_cannot_act_is_refused(model: Any, fields: dict[str, Any], message: str) -> None:
    with pytest.raises(ModelError, match=message):
        InferenceNode(RecordingContext(spec(**fields))).configure()
    assert model.calls == []


def test_compressed_pictures_need_a_decoder(model: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "cv2", None)
    load_decoder.cache_clear()
    seen = TopicSpec(name="/top", type_name="sensor_msgs/msg/CompressedImage")
    with pytest.raises(ModelError, match=r"/policy: decoding compressed images requires OpenCV: pip"):
        InferenceNode(RecordingContext(spec(subscriptions=(seen,)))).configure()


def test_a_message_that_does_not_fit_is_said_once_and_not_acted_on(
    model: Any, caplog: pytest.LogCaptureFixture
) -> None:
    features = [Feature.joints("observation.state", ("a", "b"), topic="/arm")]
    seen = TopicSpec(name="/arm", type_name="sensor_msgs/msg/JointState")
    context, node = start(
        spec(
            subscriptions=(seen,),
            facts={"joints": JOINTS, "features": features},
        )
    )

    def see_other_joints() -> bool:
        context.receive("/arm", joint_state(["c"], [1.0]))
        return any("is not used" in message for message in caplog.messages)

    wait_until(see_other_joints)
    see_other_joints()
    assert model.seen == []
    context.receive("/arm", joint_state(["b", "a"], [2.0, 1.0]))
    wait_until(lambda: bool(model.seen))
    end(context, node)
    assert model.seen[0]["observation.state"].tolist() == [1.0, 2.0]
    assert sum("is not used" in message for message in caplog.messages) == 1


def test_random_noise_runs_as_a_node() -> None:
    settings = RandomNoiseSettings.from_block(config_pb2.RandomNoiseConfig(seed=5))
    context, node = start(
        spec(
            implementation="joshua_inference.random_noise:RandomNoise",
            settings_type="joshua_inference.random_noise_settings:RandomNoiseSettings",
            settings=settings.model_dump(mode="json"),
            subscriptions=(),
            facts={"joints": JOINTS},
        )
    )
    for _ in range(20):
        wait_until(lambda: node._loop._strategy.due(node._loop._next) is not None)
        context.tick("actions")
    end(context, node)
    drawn = np.array(actions(context))
    assert np.abs(drawn).max() <= 0.5
    assert np.abs(drawn[:, 1]).max() <= 0.1
    assert len(np.unique(drawn[:, 0])) == len(drawn)


def test_a_model_is_unloaded_and_loaded_while_the_node_runs(model: Any) -> None:
    context, node = start(spec())
    play_until(context, 2, seen=1)
    assert node.unload() == "/policy: the model is unloaded; the node publishes nothing"
    assert (model.calls, context.shown) == (["load", "reset", "close"], "no model")
    silent = len(actions(context))
    for _ in range(20):
        see(context, 1)
        context.tick("actions")
        time.sleep(0.002)
    assert len(actions(context)) == silent
    with pytest.raises(RefusedError, match="/policy has no model: load it first"):
        node.unload()
    assert node.load() == "/policy: the model is loaded"
    assert context.shown == ""
    play(context, node, 100)
    with pytest.raises(RefusedError, match="/policy has already loaded its model: unload it first"):
        node.load()
    end(context, node)
    rows = {check: (passed, measured) for check, passed, measured in node.test_results()}
    assert rows["model keeps up"][0], rows  # the time without a model counts as no gap


@pytest.mark.parametrize(
    ("error", "text"),
    [
        (ModelError("the weights are gone"), "/policy: the model was not loaded: the weights are gone"),
        (OSError("no such disk"), "/policy: the model was not loaded: OSError: no such disk"),
    ],
)
def test_a_model_that_cannot_be_loaded_leaves_the_node_without_one(
    model: Any, monkeypatch: pytest.MonkeyPatch, error: Exception, text: str
) -> None:
    context, node = start(spec())
    play_until(context, 1, seen=1)
    node.unload()

    def fail(self: Any) -> None:
        raise error

    with monkeypatch.context() as broken:
        broken.setattr(model, "load", fail)
        with pytest.raises(RefusedError) as caught:
            node.load()
    assert str(caught.value) == text
    assert model.calls[-1] == "close"  # half a model is not kept
    count = len(actions(context))
    see(context, 1)
    context.tick("actions", 5)
    assert len(actions(context)) == count
    assert "the model is loaded" in node.load()
    play_until(context, count + 1, seen=1)
    end(context, node)


def test_unloading_waits_for_what_the_model_computes(model: Any) -> None:
    model.gate.clear()
    context, node = start(spec())
    see(context, 1)
    time.sleep(0.05)
    thread = threading.Thread(target=node.unload)
    thread.start()
    thread.join(0.1)
    assert thread.is_alive() or not model.seen
    model.gate.set()
    thread.join(30)
    assert model.calls[-1] == "close"
    context.tick("actions", 3)
    assert actions(context) == []
    end(context, node)


def test_its_verbs_say_what_moves(model: Any) -> None:
    context, node = configured(spec())
    verbs = verbs_of(node.verb_providers())
    assert {name: (item.moves, item.runs) for name, item in verbs.items()} == {
        "begin_episode": (True, "loop"),
        "end_episode": (False, "loop"),
        "figures": (False, "loop"),
        "load": (True, "beside"),
        "pause": (False, "loop"),
        "resume": (True, "loop"),
        "step": (True, "loop"),
        "task": (False, "loop"),
        "use_weights": (True, "beside"),
        "unload": (False, "beside"),
    }
    with pytest.raises(RefusedError, match="only an evaluation replaces them"):
        node.use_weights(Weights("elsewhere"))
    end(context, node)


def test_a_pause_holds_and_a_step_carries_out_one_chunk(model: Any) -> None:
    model.chunk = np.full((4, 2), 0.05)
    context, node = start(spec())
    see(context, 1)
    wait_until(lambda: bool(node.figures().chunks))
    play(context, node, 4)
    assert node.pause() == "/policy is paused; the arm holds"
    chunks, count = node.figures().chunks, len(actions(context))
    play(context, node, 30)
    assert node.figures().chunks == chunks
    assert len(actions(context)) == count + 30, "the hold is published"
    assert context.shown == "paused"
    model.chunk = np.full((25, 2), 0.09)
    node.step()
    wait_until(lambda: node.figures().chunks == chunks + 1)
    play(context, node, 30)
    assert node.figures().chunks == chunks + 1
    assert actions(context)[-1] == [0.09, 0.09]
    assert node.resume() == "/policy acts again"
    wait_until(lambda: node.figures().chunks > chunks + 1)
    end(context, node)


def test_a_model_that_failed_before_moves_nothing_until_it_is_resumed(model: Any) -> None:
    model.chunk = np.full((4, 2), 0.05)
    facts = {**FACTS, "restarted": True}
    context, node = start(spec(facts=facts))
    see(context, 1)
    play(context, node, 30)
    assert (actions(context), model.seen) == ([], [])
    assert context.warnings == [
        "/policy failed and was restarted. It is paused and the arm holds. Find the reason above, then "
        "run `joshua call /policy resume`"
    ]
    assert context.shown == "failed and was restarted: run `joshua call /policy resume`"
    node.resume()
    wait_until(lambda: bool(node.figures().chunks))
    play(context, node, 4)
    assert actions(context)[-1] == [0.05, 0.05]
    end(context, node)


def test_a_model_that_reads_a_task_waits_for_it(model: Any, caplog: pytest.LogCaptureFixture) -> None:
    context, node = start(
        spec(subscriptions=(), facts={"joints": JOINTS, "reads_task": True, "compute": {"warm_up": 0}})
    )
    wait_until(lambda: bool(caplog.messages))
    context.tick("actions", 30)
    assert (actions(context), model.seen) == ([], [])
    assert caplog.messages == ['waiting for a task: run `joshua task "…"`']
    assert context.shown == 'waiting for a task: run `joshua task "…"`'
    with pytest.raises(RefusedError, match="the task is empty"):
        node.task(TaskRequest(" "))
    with pytest.raises(RefusedError, match="the task has 2001 characters; 2000 are allowed"):
        node.task(TaskRequest("x" * 2001))
    assert node.task(TaskRequest("wave  slowly")) == "/policy: the task is: wave slowly"
    wait_until(lambda: bool(model.seen))
    assert model.seen[0].task == "wave slowly"
    end(context, node)


def test_an_episode_begins_with_a_fresh_model_and_ends_with_a_mark(model: Any) -> None:
    context, node = start(spec())
    see(context, 1)
    wait_until(lambda: bool(model.seen))
    resets = model.calls.count("reset")
    node.begin_episode()
    play_until(context, 3, seen=1)
    wait_until(lambda: model.calls.count("reset") == resets + 1)
    assert node.end_episode(EpisodeEnd(success=True)) == "/policy: episode 1 succeeded; the arm holds"
    figures = node.figures()
    assert (figures.episodes, figures.successes, figures.state) == (1, 1, "paused")
    assert node.end_episode(EpisodeEnd(success=False)) == "/policy: episode 1 failed; the arm holds"
    assert (node.figures().episodes, node.figures().successes) == (1, 0), "a mark can be corrected"
    node.begin_episode()
    assert node.figures().state == "acts"
    assert node.end_episode(EpisodeEnd(success=True)) == "/policy: episode 2 succeeded; the arm holds"
    assert (node.figures().episodes, node.figures().successes) == (2, 1)
    end(context, node)


def test_a_person_takes_over_and_the_model_begins_anew_afterwards(model: Any) -> None:
    model.chunk = np.full((50, 2), 0.05)
    topic, bool_message = "/arm/intervention", message_class("std_msgs/msg/Bool")
    facts = {"joints": JOINTS, "features": COUNTED, "interventions": [topic]}
    context, node = start(spec(facts=facts))
    see(context, 1)
    wait_until(lambda: bool(node.figures().chunks))
    play(context, node, 2)
    context.receive(topic, bool_message(data=True))
    count, resets = len(actions(context)), model.calls.count("reset")
    for _ in range(20):
        see(context, 1)
        context.tick("actions")
    assert len(actions(context)) == count
    context.receive(topic, bool_message(data=False))
    wait_until(lambda: model.calls.count("reset") == resets + 1)
    play_until(context, count + 1, seen=1)
    end(context, node)


def test_a_model_that_does_not_return_fails_the_node(model: Any) -> None:
    execution = {"chunk_timeout_s": 0.05}
    context, node = start(spec(facts={"joints": JOINTS, "features": COUNTED, "execution": execution}))
    model.gate.clear()
    see(context, 1)

    def failed() -> bool:
        context.tick("actions")
        time.sleep(0.002)
        return bool(context.failures)

    wait_until(failed)
    assert context.failures[0] == (
        "the model has returned no chunk for 0.05 s. Give it a faster device, or raise "
        "execution.chunk_timeout_s"
    )
    model.gate.set()
    end(context, node)


def test_a_checkpoint_that_does_not_fit_is_refused_before_the_node_is_ready(model: Any) -> None:
    other = Feature.picture("observation.images.top", 0, 0)
    model.needs = lambda self: ModelNeeds(features=(other,))
    with pytest.raises(ModelError, match=r"/policy: The model needs observation.images.top; .* Add subscr"):
        configured(spec())
    assert model.calls[-1] == "close"


def test_a_model_of_the_hub_gets_the_joints_in_the_order_of_its_checkpoint(model: Any) -> None:
    state = Feature("observation.state", "float32", (2,), ("a", "b"), "rad", "/state")
    model.needs = lambda self: ModelNeeds(action=Feature.joints("action", ("b.pos", "a.pos")))
    model.chunk = np.array([[0.05, 0.9]] * 200)
    facts = {**FACTS, "features": [state]}
    topic = TopicSpec(name="/state", type_name="sensor_msgs/msg/JointState")
    context, node = start(spec(facts=facts, subscriptions=(topic,)))
    assert model.calls[:3] == ["load", "close", "load"]
    context.receive("/state", joint_state(["a", "b"], [0.7, 0.07]))
    wait_until(lambda: bool(node.figures().chunks))
    play_until(context, 3)
    np.testing.assert_allclose(model.seen[-1]["observation.state"], [0.07, 0.7])
    message = context.publishers["/action"].messages[-1]
    assert (list(message.name), message.position.tolist()) == (["b", "a"], [0.05, 0.9])
    end(context, node)


def test_a_chunk_model_is_warmed_up_with_empty_observations(model: Any) -> None:
    model.needs = lambda self: ModelNeeds(features=())
    facts = {"joints": JOINTS, "features": COUNTED, "compute": {"warm_up": 2}}
    context, node = configured(spec(facts=facts))
    assert [observation["observation.seen"].tolist() for observation in model.seen] == [[0], [0]]
    assert model.calls[-1] == "reset"
    end(context, node)
