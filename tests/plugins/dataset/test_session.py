"""Phases of a recording session: which steps follow which request, at which times."""

from __future__ import annotations

import contextlib
from typing import Any

import pytest
from hypothesis import settings as hypothesis_settings
from hypothesis.stateful import RuleBasedStateMachine, invariant, rule
from joshua.api import RefusedError
from joshua_dataset.session import Phase, Session, Step
from joshua_dataset.settings import StoreSettings


def session(**changes: Any) -> Session:
    return Session(StoreSettings(folder="/data", tasks=("stack", "sort"), **changes))


def test_an_episode_is_started_stopped_and_kept() -> None:
    one = session()
    assert one.start(0.0) == [Step.BEGIN]
    assert one.stop(3.0) == [Step.END]
    assert one.phase is Phase.REVIEW
    assert one.keep(4.0) == [Step.KEEP]
    assert (one.phase, one.kept) == (Phase.IDLE, 1)


def test_a_start_keeps_the_episode_before() -> None:
    one = session()
    one.start(0.0)
    one.stop(1.0)
    assert one.start(2.0) == [Step.KEEP, Step.BEGIN]
    assert one.discard(3.0) == [Step.END, Step.DISCARD]
    assert (one.phase, one.kept) == (Phase.IDLE, 1)


def test_an_episode_is_recorded_anew() -> None:
    one = session()
    one.start(0.0)
    assert one.rerecord(1.0) == [Step.END, Step.DISCARD, Step.BEGIN]
    assert one.kept == 0


def test_the_last_episode_is_kept_where_it_ended_early() -> None:
    one = session(episode_duration_s=10.0, reset_duration_s=5.0, num_episodes=1)
    one.start(0.0)
    assert one.stop(3.0) == [Step.END]
    assert one.phase is Phase.RESET
    assert one.tick(8.0) == [Step.KEEP]
    assert (one.phase, one.kept) == (Phase.DONE, 1)


def test_durations_drive_a_session_to_its_end() -> None:
    one = session(episode_duration_s=10.0, reset_duration_s=5.0, warmup_s=2.0, num_episodes=2)
    assert one.start(0.0) == []
    assert one.phase is Phase.WARM_UP
    assert one.tick(1.9) == []
    assert one.tick(2.0) == [Step.BEGIN]
    assert one.tick(12.0) == [Step.END]
    assert one.phase is Phase.RESET
    assert one.tick(16.9) == []
    assert one.tick(17.0) == [Step.KEEP]
    assert one.phase is Phase.WARM_UP
    assert one.tick(19.0) == [Step.BEGIN]
    assert one.tick(29.0) == [Step.END, Step.KEEP]
    assert (one.phase, one.kept) == (Phase.DONE, 2)
    with pytest.raises(RefusedError, match="all 2 episodes are recorded"):
        one.start(30.0)


@pytest.mark.parametrize(
    ("request_", "message"),
    [
        ("stop", "no episode is being recorded: start one first"),
        ("keep", "there is no episode to keep: start one first"),
        ("discard", "there is no episode to discard: start one first"),
        ("rerecord", "there is no episode to discard: start one first"),
    ],
)
def test_requests_that_do_not_fit_are_refused(request_: str, message: str) -> None:
    with pytest.raises(RefusedError, match=message):
        getattr(session(), request_)(0.0)


def test_tasks_follow_one_another() -> None:
    one = session()
    one.next_task()
    assert one.task_text == "sort"
    with pytest.raises(RefusedError, match="'sort' is the last task: name another one"):
        one.next_task()
    one.set_task("pour")
    assert one.task_text == "pour"
    one.start(0.0)
    with pytest.raises(RefusedError, match="stop it first"):
        one.set_task("stack")
    with pytest.raises(RefusedError, match="phase recording: stop it first"):
        one.start(1.0)


def test_the_end_of_a_run_keeps_what_is_open() -> None:
    one = session()
    one.start(0.0)
    assert one.finish() == [Step.END, Step.KEEP]
    assert session().finish() == []


def test_an_episode_that_holds_nothing_does_not_complete_a_session() -> None:
    one = session(num_episodes=1)
    one.start(0.0)
    assert one.keep(1.0) == [Step.END, Step.KEEP]
    assert one.miss()
    assert (one.phase, one.kept) == (Phase.IDLE, 0)
    one.start(2.0)
    one.finish()
    assert not one.miss()  # the run ends all the same
    assert (one.phase, one.kept) == (Phase.DONE, 0)


class Recording(RuleBasedStateMachine):
    """However requests come, episodes begin, end and are decided on in turn."""

    def __init__(self) -> None:
        super().__init__()
        self.session = session(episode_duration_s=3.0, reset_duration_s=2.0, warmup_s=1.0)
        self.now_s = 0.0
        self.state = "none"
        self.kept = 0

    def follow(self, steps: list[Step]) -> None:
        for step in steps:
            allowed = {
                Step.BEGIN: {"none": "open"},
                Step.END: {"open": "ended"},
                Step.KEEP: {"ended": "none"},
                Step.DISCARD: {"ended": "none"},
            }[step]
            assert self.state in allowed, f"{step} after {self.state}"
            self.state = allowed[self.state]
            self.kept += step is Step.KEEP

    def ask(self, name: str) -> None:
        with contextlib.suppress(RefusedError):  # nothing has changed, which the invariants show
            self.follow(getattr(self.session, name)(self.now_s))

    @rule()
    def start(self) -> None:
        self.ask("start")

    @rule()
    def stop(self) -> None:
        self.ask("stop")

    @rule()
    def keep(self) -> None:
        self.ask("keep")

    @rule()
    def discard(self) -> None:
        self.ask("discard")

    @rule()
    def rerecord(self) -> None:
        self.ask("rerecord")

    @rule()
    def time_passes(self) -> None:
        self.now_s += 1.0
        self.follow(self.session.tick(self.now_s))

    @invariant()
    def phase_fits(self) -> None:
        expected = {"none": (Phase.IDLE, Phase.WARM_UP), "open": (Phase.RECORDING,)}
        assert self.session.phase in expected.get(self.state, (Phase.REVIEW, Phase.RESET))
        assert self.session.kept == self.kept


TestRecording = Recording.TestCase
TestRecording.settings = hypothesis_settings(max_examples=60, stateful_step_count=30)
