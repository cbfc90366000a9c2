"""Services of a running robot over Zenoh: parameters and verbs, from the command line."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import pytest
from joshua.testing.domain import reserved_domain
from joshua.testing.program import JoshuaProgram
from leader_and_copy import LEADER_AND_COPY

BESIDE: list[Callable[..., Any]] = []
PARAMETERS = (
    "describe_parameters",
    "get_parameter_types",
    "get_parameters",
    "list_parameters",
    "set_parameters",
    "set_parameters_atomically",
)


@pytest.fixture(scope="module")
def service(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Callable[..., Any]]:
    """Runs ``joshua service`` beside a running robot."""
    folder = tmp_path_factory.mktemp("services")
    (folder / "robot.pbtxt").write_text(LEADER_AND_COPY, encoding="utf-8")
    with reserved_domain() as domain_id:
        joshua = JoshuaProgram(folder, domain_id)
        place = f'transport {{ kind: TRANSPORT_ZENOH listen_endpoints: "{joshua.router}" }}'
        (folder / "place.pbtxt").write_text(place, encoding="utf-8")
        run = joshua.start("--config", "robot.pbtxt")
        assert run.stdout is not None
        assert any(" ready after " in line for line in run.stdout)
        options = ("--config=place.pbtxt", "--wait=30")
        BESIDE.append(lambda *words: joshua.start(*words, *options))
        yield lambda *words: joshua("service", words[0], *options, *words[1:])
        BESIDE.clear()
        joshua.close()


@pytest.fixture
def joshua_beside(service: Callable[..., Any]) -> Callable[..., Any]:
    """Starts another command beside the robot."""
    return BESIDE[0]


def test_every_node_offers_its_parameters_and_verbs(service: Callable[..., Any]) -> None:
    lines = service("list", "-t").stdout.splitlines()
    for node in ("/arm", "/copy"):
        for name in PARAMETERS:
            kind = "".join(part.capitalize() for part in name.split("_"))
            assert f"{node}/{name} [rcl_interfaces/srv/{kind}]" in lines
    assert "/copy/resume [std_srvs/srv/Trigger]" in lines
    assert "/copy/limit_speed [rcl_interfaces/srv/SetParametersAtomically]" in lines
    assert "/copy/get_state [lifecycle_msgs/srv/GetState]" in lines
    assert service("type", "/copy/resume").stdout == "std_srvs/srv/Trigger\n"


def test_parameters_are_the_settings_of_the_node_and_fixed(service: Callable[..., Any]) -> None:
    names = service("call", "/copy/list_parameters").stdout
    assert "use_sim_time" in names
    assert "num_motors" in names
    values = service("call", "/copy/get_parameters", "{names: [num_motors, nonsense]}").stdout
    assert "integer_value: 2" in values
    assert "- type: 0" in values, "a parameter that is not there has no type"
    described = service("call", "/copy/describe_parameters", "{names: [num_motors]}").stdout
    assert "type: 2" in described
    assert "read_only: true" in described
    refused = service("call", "/copy/set_parameters", "{parameters: [{name: num_motors}, {name: nonsense}]}")
    assert "change it there and restart the run" in refused.stdout
    assert "no parameter 'nonsense'" in refused.stdout
    types = service("call", "/copy/get_parameter_types", "{names: [num_motors, use_sim_time]}")
    assert types.stdout == "types: [2, 1]\n"


def test_a_verb_with_a_request_takes_named_values(service: Callable[..., Any]) -> None:
    def limit(value: str) -> str:
        request = f"{{parameters: [{{name: scale, value: {{type: 3, double_value: {value}}}}}]}}"
        return str(service("call", "/copy/limit_speed", request).stdout)

    assert "the joints use 50% of their speed limits" in limit("0.5")
    assert "successful: true" in limit("0.75")
    refused = limit("1.5")
    assert "successful: false" in refused
    assert "it must be above 0 and at most 1" in refused
    unknown = service("call", "/copy/limit_speed", "{parameters: [{name: scala, value: {type: 3}}]}").stdout
    assert "scala: no such field; did you mean scale?" in unknown


def test_a_parameter_that_a_verb_sets_changes_and_its_event_is_published(
    service: Callable[..., Any], joshua_beside: Callable[..., Any]
) -> None:
    listener = joshua_beside("topic", "echo", "/parameter_events", "--once", "--full")
    said = ""
    for scale in range(1, 60):  # the listener has its own time to start
        value = f"{{name: speed_scale, value: {{type: 3, double_value: {scale / 100}}}}}"
        said = service("call", "/copy/set_parameters", f"{{parameters: [{value}]}}").stdout
        assert "successful: true" in said
        if listener.poll() is not None:
            break
    event = listener.communicate(timeout=60)[0]
    assert "node: /copy" in event
    assert "name: speed_scale" in event
    assert (
        f"double_value: {scale / 100}"
        in service("call", "/copy/get_parameters", "{names: [speed_scale]}").stdout
    )
    described = service("call", "/copy/describe_parameters", "{names: [speed_scale]}").stdout
    assert "read_only: false" in described
    wrong = "{parameters: [{name: speed_scale, value: {type: 4, string_value: fast}}]}"
    assert "speed_scale is of type float" in service("call", "/copy/set_parameters", wrong).stdout


def test_a_node_is_an_active_managed_node_and_the_run_alone_stops_it(service: Callable[..., Any]) -> None:
    assert "label: active" in service("call", "/copy/get_state").stdout
    assert "available_transitions: []" in service("call", "/copy/get_available_transitions").stdout
    refused = service("call", "/copy/change_state", "{transition: {id: 4, label: deactivate}}")
    assert (refused.returncode, refused.stdout) == (1, "success: false\n")


def test_a_verb_that_gives_torque_is_refused_with_the_reason(service: Callable[..., Any]) -> None:
    refused = service("call", "/copy/resume")
    assert refused.returncode == 1
    assert "success: false" in refused.stdout
    assert "only the user who runs the robot may call it" in refused.stdout


def test_a_service_that_is_not_there_and_a_wrong_request_are_named(service: Callable[..., Any]) -> None:
    unknown = service("call", "/copi/resume", "--wait", "3")
    assert (unknown.returncode, unknown.stdout) == (2, "")
    assert "no node offers the service /copi/resume. Did you mean /copy/resume?" in unknown.stderr
    wrong = service("call", "/copy/get_parameters", "{name: [a]}")
    assert wrong.returncode == 2
    assert "did you mean names?" in wrong.stderr
    over_dds = service("list", "--transport", "dds")
    assert over_dds.returncode == 1
    assert "the transport dds carries no services. Use --transport zenoh" in over_dds.stderr
