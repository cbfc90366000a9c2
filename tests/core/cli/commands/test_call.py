"""``joshua call`` and ``joshua status --watch``: a run in another process, and what each refusal says."""

from __future__ import annotations

import argparse
import json
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from eventually import eventually
from joshua.cli.commands import call
from joshua.ipc.client import CallError, RunInfo, RunningSystem
from joshua.testing.domain import reserved_domain
from joshua.testing.program import JoshuaProgram
from same_process import joshua_here

PRESET = Path(__file__).parents[4] / "configs/inference_random_noise.pbtxt"


@pytest.fixture
def joshua(tmp_path: Path) -> Iterator[JoshuaProgram]:
    with reserved_domain() as domain_id:
        program = JoshuaProgram(tmp_path, domain_id)
        yield program
        program.close()


def started(joshua: JoshuaProgram) -> subprocess.Popen[str]:
    run = joshua.start("--config", str(PRESET), "--duration", "200")
    assert run.stdout is not None
    assert any(" ready after " in line for line in run.stdout)
    return run


def here(joshua: JoshuaProgram, *words: str) -> subprocess.CompletedProcess[str]:
    return joshua_here(*words, environment=joshua.environment, folder=joshua.folder)


def rates(joshua: JoshuaProgram) -> dict[str, float]:
    (status,) = json.loads(here(joshua, "status", "--format", "json").stdout)
    node = next(node for node in status["nodes"] if node["full_name"] == "/random_noise")
    return dict(node["published_hz"])


def logged(folder: Path, text: str) -> bool:
    return any(text in path.read_text() for path in folder.glob("log/*.jsonl"))


def test_a_model_is_unloaded_and_loaded_and_the_arm_holds_meanwhile(
    joshua: JoshuaProgram, tmp_path: Path
) -> None:
    run = started(joshua)
    listed = joshua("call")
    assert (
        "\n  release_override  End an override and return control to the leader or model of the file. "
        "(local only)\n  resume  End a fault: check the device as at the start, and energise" in listed.stdout
    )
    assert "  load  Load the model, which then acts again. (local only)\n" in listed.stdout
    assert "  unload  Unload the model;" in listed.stdout
    unloaded = joshua("call", "random_noise", "unload")
    assert unloaded.stdout == "/random_noise: the model is unloaded; the node publishes nothing\n", (
        unloaded.stderr
    )
    eventually(lambda: not any(rates(joshua).values()))
    eventually(lambda: logged(tmp_path, "commands stopped: the joints hold their position"))
    again = here(joshua, "call", "random_noise", "unload")
    assert (again.returncode, again.stderr) == (
        1,
        "joshua call: /random_noise has no model: load it first\n",
    )
    loaded = joshua("call", "/random_noise", "load", "--format", "json")
    assert json.loads(loaded.stdout) == {"text": "/random_noise: the model is loaded"}
    eventually(lambda: any(rates(joshua).values()))
    eventually(lambda: logged(tmp_path, "commands resumed: the joints approach them slowly"))
    typo = here(joshua, "call", "random_noise", "laod")
    assert (typo.returncode, typo.stderr) == (
        2,
        "joshua call: /random_noise has no verb 'laod'\n  allowed: load, unload, begin_episode, "
        "end_episode, figures, pause, resume, step, task, use_weights\n",
    )
    other = here(joshua, "call", "random_nose", "load")
    assert other.returncode == 2
    assert "no node is named 'random_nose'\n  allowed: /random_noise, " in other.stderr
    joshua.stop(run)


def test_events_are_watched_to_the_end(joshua: JoshuaProgram) -> None:
    run = started(joshua)
    shown = joshua.start("status", "--watch")
    watched = joshua.start("status", "--watch", "--format", "json")
    assert watched.stdout is not None
    assert shown.stdout is not None
    first = json.loads(watched.stdout.readline())
    assert (first["event"], first["phase"]) == ("status", "running")
    assert shown.stdout.readline().startswith("running ")
    joshua.stop(run)
    output, errors = watched.communicate(timeout=60)
    events = [json.loads(line) for line in output.splitlines()]
    assert (watched.returncode, errors) == (0, "")
    assert {event["run"] for event in events} == {first["run"]}
    assert [event["event"] for event in events][-2:] == ["stopped", "report"]
    assert ["/mock_arm", "stopped"] in [[event.get("node"), event["event"]] for event in events]
    text, errors = shown.communicate(timeout=60)
    assert (shown.returncode, errors) == (0, "")
    assert "/mock_arm stopped: " in text
    assert joshua("status", "--watch").stdout == "no system is running\n"


def arguments(**fields: Any) -> argparse.Namespace:
    defaults: dict[str, Any] = {
        "node": "arm",
        "verb": "wave",
        "fields": [],
        "config": None,
        "timeout": 1.0,
        "start": False,
        "format": "text",
    }
    return argparse.Namespace(**{**defaults, **fields})


class Fake(RunningSystem):
    """A run that answers as the test says."""

    def __init__(self, answer: Any, nodes: tuple[str, ...] = ("/arm",), run: str = "x") -> None:
        super().__init__(Path("/nowhere"), RunInfo(run, 7, "r.pbtxt", "", 0, nodes))
        self.answer = answer
        self.asked: dict[str, Any] = {}

    def request(self, request: Any, timeout_s: float = 5.0) -> dict[str, Any]:
        self.asked = dict(request)
        if isinstance(self.answer, Exception):
            raise self.answer
        return dict(self.answer)


@pytest.fixture
def runs(monkeypatch: pytest.MonkeyPatch) -> list[RunningSystem]:
    systems: list[RunningSystem] = []
    monkeypatch.setattr(RunningSystem, "all", lambda *_: systems)
    return systems


@pytest.mark.parametrize(
    ("words", "payload"),
    [
        ([], {}),
        (["count=10", "name=left arm", "x=true"], {"count": "10", "name": "left arm", "x": "true"}),
        (['{"count": 10}'], {"count": 10}),
        (["joints.gripper=0.5", "joints.wrist=1"], {"joints": {"gripper": "0.5", "wrist": "1"}}),
        (["list=[1, 2]", 'text="a=b"', "none=null"], {"list": [1, 2], "text": "a=b", "none": None}),
        (["equation=a=b"], {"equation": "a=b"}),
    ],
)
def test_words_become_the_request(runs: list[RunningSystem], words: list[str], payload: Any) -> None:
    system = Fake({"reply": {}})
    runs.append(system)
    assert call.run(arguments(fields=words)) == 0
    assert system.asked["payload"] == payload


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (["count"], "'count': expected FIELD=VALUE, such as count=10, or one JSON object"),
        (["=1"], "'=1': expected FIELD=VALUE, such as count=10, or one JSON object"),
        (["list=[1,"], "'[1,' is not JSON: Expecting value"),
        (["{count}"], "'{count}' is not JSON: Expecting property name"),
    ],
)
def test_words_that_are_no_request_are_said(
    runs: list[RunningSystem], capsys: pytest.CaptureFixture[str], words: list[str], text: str
) -> None:
    runs.append(Fake({"reply": {}}))
    assert call.run(arguments(fields=words)) == 2
    assert text in capsys.readouterr().err


@pytest.mark.parametrize(
    ("code", "exit_code"),
    [
        *(("unknown-node", 2), ("unknown-verb", 2), ("invalid", 2)),
        *(("refused", 1), ("failed", 1), ("gone", 1), ("timeout", 1), ("not-running", 1), ("unreachable", 1)),
    ],
)
def test_the_exit_code_says_whether_the_user_can_mend_it(
    runs: list[RunningSystem], capsys: pytest.CaptureFixture[str], code: str, exit_code: int
) -> None:
    runs.append(Fake(CallError(code, "because", ["this", "that"])))
    assert call.run(arguments()) == exit_code
    assert capsys.readouterr().err == "joshua call: because\n  allowed: this, that\n"


def test_replies_are_shown(runs: list[RunningSystem], capsys: pytest.CaptureFixture[str]) -> None:
    for reply, text in (
        ({}, "done\n"),
        ({"text": "waved"}, "waved\n"),
        ({"done": 3, "side": "left"}, 'done: 3\nside: "left"\n'),
    ):
        runs[:] = [Fake({"reply": reply})]
        assert call.run(arguments()) == 0
        assert capsys.readouterr().out == text


def test_which_system_and_node_must_be_clear(
    runs: list[RunningSystem], capsys: pytest.CaptureFixture[str]
) -> None:
    assert call.run(arguments()) == 1
    assert "no system is running. Start one: joshua --config FILE" in capsys.readouterr().err
    runs += [Fake({}), Fake({}, ("/arm", "/left/leg", "/right/leg"), "y")]
    assert call.run(arguments()) == 2
    assert "several nodes are named 'arm': give the full name, or --config FILE\n" in capsys.readouterr().err
    assert call.run(arguments(node="leg")) == 2
    assert "several nodes are named 'leg'" in capsys.readouterr().err
    assert call.run(arguments(node="lge")) == 2
    assert "no node is named 'lge'" in capsys.readouterr().err
    assert call.run(arguments(config="other.pbtxt")) == 1
    assert "other.pbtxt is not running" in capsys.readouterr().err


def test_a_node_that_does_not_answer_is_a_row_of_the_list(
    runs: list[RunningSystem], capsys: pytest.CaptureFixture[str]
) -> None:
    runs.append(Fake(CallError("timeout", "/arm has not answered verbs within 1 s: it is in its loop")))
    assert call.run(arguments(node="", verb="")) == 0
    assert capsys.readouterr().out == "/arm\n  /arm has not answered verbs within 1 s: it is in its loop\n"
    assert call.run(arguments(node="", verb="", format="json")) == 0
    (row,) = json.loads(capsys.readouterr().out)
    assert (row["system"], row["node"], row["verbs"]) == (7, "/arm", [])
