"""A model that takes its time drives an arm: the task, a pause, and what a model does wrong."""

from __future__ import annotations

import contextlib
import json
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from certificates import Authority
from eventually import eventually
from joshua.testing.domain import reserved_domain
from joshua.testing.port import free_port
from joshua.testing.program import JoshuaProgram
from terminal_run import TerminalRun

RAW_CLIENT = str(Path(__file__).parents[1] / "core/transport/programs/raw_zenoh.py")
TOY = Path(__file__).parents[1] / "support/toy_policy"
# as in the specification, the model subscribes to no state, and the file has no task
FILE = """
general { mode: MODE_INFERENCE robot_type: "toy" name: "toy" id: "toy" }
robot {
  actions {
    node {
      node_name: "arm" node_id: 1
      publishers { data_type: JOINT_STATE topic_name: "/arm/joint_states" publish_rate_hz: 50 }
      subscriptions { data_type: JOINT_STATE topic_name: "/ai/actions" }
    }
    action_type: ACTION_MOCK
    mock_motor_config { num_motors: 2 position_max: 4095 }
  }
}
ai {
  models {
    model_type: MODEL_PLUGIN
    node {
      node_name: "policy" node_id: 2 restart: RESTART_NEVER
      publishers { data_type: JOINT_STATE topic_name: "/ai/actions" publish_rate_hz: 30 }
    }
    plugin_config { [type.example.org/toy.PolicyConfig] { latency_s: 0.1 %s } }
    execution { chunk_timeout_s: 1.0 }
  }
}
"""


@pytest.fixture
def joshua(tmp_path: Path) -> Iterator[JoshuaProgram]:
    with reserved_domain() as domain_id:
        program = JoshuaProgram(tmp_path, domain_id, {"PYTHONPATH": str(TOY)})
        yield program
        program.close()


def write(folder: Path, block: str) -> str:
    path = folder / "toy.pbtxt"
    path.write_text(FILE % block)
    return str(path)


def ready(joshua: JoshuaProgram, *arguments: str) -> Any:
    run = joshua.start(*arguments, "--duration", "200")
    assert run.stdout is not None
    assert any(" ready after " in line for line in run.stdout)
    return run


def figures(joshua: JoshuaProgram) -> dict[str, Any]:
    reply = joshua("call", "policy", "figures", "--format", "json")
    assert reply.returncode == 0, reply.stderr
    return dict(json.loads(reply.stdout))


def by_keys(joshua: JoshuaProgram) -> None:
    """A person at a terminal controls the episodes by keys, and leaves; the run continues."""
    command = [sys.executable, "-m", "joshua.cli.main", "episode"]
    with contextlib.closing(TerminalRun(command, joshua.environment)) as screen:
        screen.wait_for("/policy: acts\r\nepisodes: 1 ", "b begin   s success   f failure   p pause")
        for key, answer in (
            ("p", "/policy is paused; the arm holds"),
            ("n", "/policy executes one chunk"),
            ("f", "/policy: episode 2 failed; the arm holds"),
            ("b", "/policy: the episode begins"),
            ("s", "/policy: episode 3 succeeded; the arm holds"),
            ("r", "/policy acts again"),
        ):
            screen.type(key)
            screen.wait_for(answer)
        screen.wait_for("episodes: 3   succeeded: 1 (33%)")
        screen.type("q")
        assert screen.end() == 0
        assert screen.attributes() == screen.first


def test_a_model_waits_for_its_task_acts_and_pauses(joshua: JoshuaProgram, tmp_path: Path) -> None:
    run = ready(joshua, "--config", write(tmp_path, "reads_task: true"))
    assert figures(joshua)["chunks"] == 0
    missing = joshua("task", "--node", "polisy", "wave")
    assert (missing.returncode, missing.stderr) == (
        2,
        "joshua task: no model is named 'polisy'\n  allowed: /policy\n",
    )
    told = joshua("task", "Wave slowly.")
    assert told.stdout == "/policy: the task is: Wave slowly.\n", told.stderr
    eventually(lambda: figures(joshua)["chunks"] > 3)
    place = f'transport {{ kind: TRANSPORT_ZENOH listen_endpoints: "{joshua.router}" }}'
    (tmp_path / "place.pbtxt").write_text(place)

    def service(name: str, request: str) -> str:
        options = ("--config=place.pbtxt", "--wait=30")
        return str(joshua("service", "call", *options, f"/policy/{name}", request).stdout)

    by_service = "{parameters: [{name: text, value: {type: 4, string_value: Stop waving.}}]}"
    assert "successful: true" in service("task", by_service)
    by_parameter = "{parameters: [{name: task, value: {type: 4, string_value: Wave again.}}]}"
    assert "successful: true" in service("set_parameters", by_parameter)
    assert "string_value: Wave again." in service("get_parameters", "{names: [task]}")
    marked = joshua("episode", "success")
    assert marked.stdout == "/policy: episode 1 succeeded; the arm holds\n", marked.stderr
    assert "success: true" in service("end_episode", "{data: false}")
    assert (figures(joshua)["episodes"], figures(joshua)["successes"]) == (1, 0)
    assert joshua("episode", "begin").stdout == "/policy: the episode begins\n"
    by_keys(joshua)
    assert joshua("call", "policy", "pause").stdout == "/policy is paused; the arm holds\n"
    paused = figures(joshua)
    assert paused["latency_p50_s"] > 0.1
    assert paused["skipped"] > 0
    output, errors = joshua.stop(run)
    assert "waiting for a task: run `joshua task" in output + errors
    assert re.search(r"chunks: [23]\d(\.\d)? Hz, queue \d+, model [\d.]+/[\d.]+ ms, age", output + errors)
    nobody = joshua("episode", "begin")
    assert (nobody.returncode, nobody.stderr) == (
        1,
        "joshua episode: no system is running. Start one: joshua --config FILE\n",
    )
    lost = joshua("task", "wave")
    assert (lost.returncode, lost.stderr) == (
        1,
        "joshua task: no system is running. Start one: joshua --config FILE\n",
    )


@pytest.mark.parametrize(
    ("fault", "said"),
    [
        ("nan", "/policy: failed: ToyPolicy.act returned a value that is not finite"),
        ("hang", "/policy: failed: the model has returned no chunk for 1 s. Give it a faster device"),
        ("die", "/policy: failed: its process ended with exit status 9"),
    ],
    ids=["nan", "hang", "die"],
)
def test_a_model_that_fails_says_so_and_the_arm_holds(
    joshua: JoshuaProgram, tmp_path: Path, fault: str, said: str
) -> None:
    result = joshua("--config", write(tmp_path, f'fault: "{fault}"'), "--duration", "4")
    output = result.stdout + result.stderr
    assert result.returncode == 1, output
    assert said in output
    assert "Traceback" not in output
    assert "/arm: commands stopped: the joints hold their position" in output


def test_a_cut_link_to_a_model_on_another_machine_ends_in_a_hold(
    joshua: JoshuaProgram, tmp_path: Path
) -> None:
    """The link is encrypted: each machine has a certificate, and without one nobody is connected."""
    robots, other = Authority(tmp_path, "robots"), Authority(tmp_path, "others")
    here = joshua.router.replace("tcp/", "tls/")
    joshua.router = ""

    def file(name: str, listens: str, connects: str = "") -> str:
        certificate, key = robots.issue(name)
        tls = f'root_ca_file: "{robots.file}" certificate_file: "{certificate}" private_key_file: "{key}"'
        block = f'listen_endpoints: "{listens}" {connects} tls {{ {tls} }}'
        model = FILE.replace('"policy" node_id: 2', '"policy" node_id: 2 host: "desk"') % ""
        path = tmp_path / f"{name}.pbtxt"
        path.write_text(f"{model}transport {{ kind: TRANSPORT_ZENOH {block} }}")
        return str(path)

    robot = ready(joshua, "--config", file("robot", here))
    desk_file = file("desk", f"tls/localhost:{free_port()}", f'connect_endpoints: "{here}"')
    desk = ready(joshua, "--config", desk_file, "--host", "desk")
    guests = [
        subprocess.Popen(
            [sys.executable, RAW_CLIENT, here, robots.file, "3", *own], stdout=subprocess.PIPE, text=True
        )
        for own in ((), other.issue("guest"))
    ]
    eventually(lambda: figures(joshua)["chunks"] > 2)

    def commands_hz() -> float:
        systems = json.loads(joshua("status", "--format", "json").stdout)
        nodes = [node for system in systems for node in system["nodes"] if node["full_name"] == "/arm"]
        return float(nodes[0]["received_hz"]["/ai/actions"])

    eventually(lambda: commands_hz() > 0)
    for guest in guests:
        assert json.loads(guest.communicate(timeout=60)[0]) == {"connected": False, "heard": []}
    desk.kill()
    eventually(lambda: commands_hz() == 0)
    output, errors = joshua.stop(robot)
    assert "/arm: commands stopped: the joints hold their position" in output + errors
