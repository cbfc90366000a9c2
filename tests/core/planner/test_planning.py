"""From a file to a plan."""

from pathlib import Path

import pytest
from joshua.features import FeatureSet
from joshua.plan import NodeKind, Severity
from joshua.planner.pipeline import PipelineResult, examine
from joshua.planner.request import Purpose, Request

GENERAL = 'general { mode: MODE_TELEOPERATE name: "rig" id: "rig-1" }\n'

LEADER = """
  actions {
    node {
      node_name: "leader" node_id: 1 node_type: PYTHON
      publishers { data_type: JOINT_STATE topic_name: "/leader/joint_states" publish_rate_hz: 50 }
    }
    action_type: ACTION_LEADER
    mock_motor_config { num_motors: 2 position_min: 1024 position_max: 3072 }
  }
"""

FOLLOWER = """
  actions {
    node {
      node_name: "follower" node_id: 2 node_type: PYTHON
      qos { depth: 3 }
      publishers { data_type: JOINT_STATE topic_name: "/follower/joint_states" publish_rate_hz: 50 }
      subscriptions { data_type: JOINT_STATE topic_name: "/leader/joint_states" }
    }
    action_type: ACTION_FOLLOWER
    mock_motor_config { num_motors: 2 position_max: 4095 }
  }
"""


def write(folder: Path, text: str) -> str:
    path = folder / "robot.pbtxt"
    path.write_text(text)
    return str(path)


def teleoperation(folder: Path, more: str = "", *, general: str = GENERAL) -> str:
    return write(folder, f"{general}robot {{ {FOLLOWER} {LEADER} }}\n{more}")


@pytest.fixture(autouse=True)
def plain_environment(monkeypatch):
    for name in ("RMW_IMPLEMENTATION", "ROS_DOMAIN_ID", "ROS_DISTRO", "ROS_AUTOMATIC_DISCOVERY_RANGE"):
        monkeypatch.delenv(name, raising=False)


def codes(examination: PipelineResult) -> list[tuple[str, Severity]]:
    return [(item.code, item.severity) for item in examination.diagnostics]


def test_publishers_start_before_those_that_listen(tmp_path):
    plan = examine(Request(teleoperation(tmp_path))).plan
    assert [node.full_name for node in plan.nodes] == ["/leader", "/follower"]
    assert [node.kind for node in plan.nodes] == [NodeKind.ACTUATOR, NodeKind.ACTUATOR]


def test_topics_carry_type_rate_and_the_profile_in_force(tmp_path):
    leader, follower = examine(Request(teleoperation(tmp_path))).plan.nodes
    (state,) = leader.publishers
    assert (state.name, state.type_name, state.rate_hz) == (
        "/leader/joint_states",
        "sensor_msgs/msg/JointState",
        50.0,
    )
    assert state.qos.depth == 10
    assert follower.subscriptions[0].qos.depth == 3


def test_random_noise_needs_no_block_of_its_own(tmp_path):
    path = tmp_path / "robot.pbtxt"
    path.write_text("""
general { mode: MODE_INFERENCE name: "rig" id: "rig-1" }
robot { actions { node { node_name: "arm" node_id: 1
    subscriptions { data_type: JOINT_STATE topic_name: "/ai/actions" } }
  action_type: ACTION_MOCK mock_motor_config { num_motors: 2 position_max: 4095 } } }
ai { models { model_type: RANDOM_NOISE node { node_name: "noise" node_id: 2
    publishers { data_type: JOINT_STATE topic_name: "/ai/actions" publish_rate_hz: 10 } } } }
""")
    examination = examine(Request(str(path)))
    assert not examination.errors
    (noise,) = [node for node in examination.plan.nodes if node.name == "noise"]
    assert noise.settings["seed"] == 0
    assert noise.settings["amplitude_rad"] > 0


def test_a_model_knows_the_features_that_it_observes(tmp_path):
    path = write(
        tmp_path,
        """
general { mode: MODE_INFERENCE name: "rig" id: "rig-1" }
robot {
  actions { node { node_name: "arm" node_id: 1
      publishers { data_type: JOINT_STATE topic_name: "/arm/joint_states" publish_rate_hz: 50 }
      subscriptions { data_type: JOINT_STATE topic_name: "/ai/actions" } }
    action_type: ACTION_MOCK mock_motor_config { num_motors: 2 position_max: 4095 } }
  perceptions { node { node_name: "camera_top" node_id: 2
      publishers { data_type: IMAGE topic_name: "/camera/top/image_raw" publish_rate_hz: 10 } }
    perception_type: PERCEPTION_CAMERA mock_camera_config { width: 64 height: 48 fps: 10 } }
}
ai { models { model_type: RANDOM_NOISE node { node_name: "noise" node_id: 3
    publishers { data_type: JOINT_STATE topic_name: "/ai/actions" publish_rate_hz: 10 }
    subscriptions { data_type: IMAGE topic_name: "/camera/top/image_raw" }
    subscriptions { data_type: JOINT_STATE topic_name: "/arm/joint_states" } } } }
""",
    )
    examination = examine(Request(path))
    assert not examination.errors
    (noise,) = [node for node in examination.plan.nodes if node.name == "noise"]
    features = FeatureSet(noise.facts.features)
    assert list(features) == ["observation.images.top", "observation.state"]
    assert features["observation.images.top"].shape == (48, 64, 3)
    assert features["observation.state"].names == ("joint_1", "joint_2")
    assert features["observation.state"].topic == "/arm/joint_states"


def test_a_missing_plugin_is_a_note_before_and_an_error_at_the_launch(tmp_path):
    path = teleoperation(tmp_path)
    before = examine(Request(path, blocked_plugins=("mock",)))
    assert ("plugin-missing", Severity.NOTE) in codes(before)
    assert not any(severity is Severity.ERROR for _, severity in codes(before))
    launch = examine(Request(path, blocked_plugins=("mock",), purpose=Purpose.LAUNCH))
    assert ("plugin-missing", Severity.ERROR) in codes(launch)
    assert launch.plan is None


def test_a_mock_whose_plugin_is_missing_needs_no_emulator(tmp_path):
    found = examine(Request(teleoperation(tmp_path), blocked_plugins=("mock",), emulate=True))
    assert {item.code for item in found.diagnostics} == {"plugin-missing"}


@pytest.mark.parametrize(
    ("before", "after", "found"),
    [
        ("position_max: 3072", "position_max: 1000", ["limits-inverted"]),
        ("ACTION_LEADER", "ACTION_SPIKE", ["mode-lacks-leader", "block-unfit"]),
        ("num_motors: 2 position_min: 1024", 'num_motors: "two" position_min: 1024', ["wrong-type"]),
        ("num_motors: 2 position_min: 1024", "num_motor: 2 position_min: 1024", ["unknown-field"]),
        ("MODE_TELEOPERATE", "MODE_TRAINING", ["block-unused", "unknown-enum-value"]),
    ],
    ids=["limits", "unfit", "broken", "misspelt", "training"],
)
def test_one_mistake_is_one_finding_whoever_else_could_complain(tmp_path, before, after, found):
    training = "environment: ENV_SIMULATION method: METHOD_RL simulator_backend: BACKEND_MUJOKO"
    path = teleoperation(tmp_path, f"ai {{ training {{ {training} }} }}" if "TRAINING" in after else "")
    Path(path).write_text(Path(path).read_text().replace(before, after))
    examination = examine(Request(path, purpose=Purpose.VALIDATE))
    assert sorted(item.code for item in examination.diagnostics) == sorted(found)


def test_nodes_that_lack_the_same_plugin_share_a_finding(tmp_path):
    examination = examine(Request(teleoperation(tmp_path), blocked_plugins=("mock",)))
    (finding,) = [item for item in examination.diagnostics if item.code == "plugin-missing"]
    assert finding.message.startswith("follower, leader: mock_motor_config requires the plugin joshua-mock")
    assert [place.label for place in finding.related] == ["leader needs it too"]


@pytest.mark.parametrize(
    ("purpose", "severity"), [(Purpose.LAUNCH, Severity.WARNING), (Purpose.VALIDATE, Severity.NOTE)]
)
def test_a_data_store_beside_teleoperation_is_optional(tmp_path, purpose, severity):
    store = """
ai { data_store {
  format: FORMAT_HUGGINGFACE storage: STORAGE_LOCAL dataset_name: "demo" local_path: "demo" } }
"""
    request = Request(teleoperation(tmp_path, store), purpose=purpose, blocked_plugins=("dataset",))
    examination = examine(request)
    (missing,) = [item for item in examination.diagnostics if item.code == "plugin-missing"]
    assert missing.severity is severity
    assert missing.message.startswith("data_store: FORMAT_HUGGINGFACE requires the plugin joshua-dataset")
    assert missing.message.endswith("; the run continues without it.")
    assert missing.remedy == "Install the plugin, or remove the data_store block."
    assert not examination.errors
    assert (examination.plan is not None) == (purpose is Purpose.LAUNCH)


def test_a_test_runs_ten_seconds_unless_it_says_otherwise(tmp_path):
    general = GENERAL.replace("MODE_TELEOPERATE", "MODE_TEST")
    assert examine(Request(teleoperation(tmp_path, general=general))).plan.duration_s == 10
    path = teleoperation(tmp_path, "test { duration_s: 2.5 }", general=general)
    assert examine(Request(path)).plan.duration_s == 2.5
    assert examine(Request(path, duration_s=1.0)).plan.duration_s == 1.0
    assert examine(Request(teleoperation(tmp_path))).plan.duration_s is None


def test_each_machine_starts_its_share(tmp_path):
    path = teleoperation(tmp_path)
    text = Path(path).read_text().replace('node_name: "follower"', 'node_name: "follower" host: "jetson"')
    Path(path).write_text(text)
    assert [node.name for node in examine(Request(path)).plan.nodes] == ["leader"]
    assert [node.name for node in examine(Request(path, host="jetson")).plan.nodes] == ["follower"]


def test_an_unknown_host_names_the_nearest(tmp_path):
    path = teleoperation(tmp_path)
    text = Path(path).read_text().replace('node_name: "follower"', 'node_name: "follower" host: "jetson"')
    Path(path).write_text(text)
    validation = examine(Request(path, host="jetsn", purpose=Purpose.VALIDATE))
    assert [item.code for item in validation.errors] == ["unknown-host"]
    examination = examine(Request(path, host="jetsn"))
    (finding,) = [item for item in examination.diagnostics if item.code == "unknown-host"]
    assert finding.found == "jetsn"
    assert finding.allowed == ("jetson",)
    assert "--host" in finding.remedy
    assert examination.plan is None


def test_a_name_to_block_that_is_no_plugin_is_a_warning_with_the_nearest(tmp_path):
    examination = examine(Request(teleoperation(tmp_path), blocked_plugins=("joshua-cor", "core")))
    (finding,) = [item for item in examination.diagnostics if item.code == "block-unknown"]
    assert (finding.severity, finding.found) == (Severity.WARNING, "joshua-cor")
    assert finding.allowed[0] == "joshua-core"


def test_a_file_whose_nodes_all_name_hosts_asks_for_one(tmp_path):
    path = teleoperation(tmp_path)
    text = Path(path).read_text()
    for name in ("follower", "leader"):
        text = text.replace(f'node_name: "{name}"', f'node_name: "{name}" host: "jetson"')
    Path(path).write_text(text)
    (finding,) = [item for item in examine(Request(path)).diagnostics if item.code == "host-needed"]
    assert finding.remedy == "Add --host jetson."


def test_the_environment_chooses_the_transport(tmp_path, monkeypatch):
    monkeypatch.setenv("ROS_DOMAIN_ID", "42")
    monkeypatch.setenv("RMW_IMPLEMENTATION", "rmw_zenoh_cpp")
    transport = examine(Request(teleoperation(tmp_path))).plan.transport
    assert (transport.kind, transport.domain_id) == ("zenoh", 42)
    assert transport.reason == "RMW_IMPLEMENTATION=rmw_zenoh_cpp"


def test_an_environment_that_ros_does_not_know_is_a_finding(tmp_path, monkeypatch):
    monkeypatch.setenv("RMW_IMPLEMENTATION", "rmw_zeno_cpp")
    examination = examine(Request(teleoperation(tmp_path)))
    (finding,) = [item for item in examination.diagnostics if item.code == "transport-environment"]
    assert finding.allowed[0] == "rmw_zenoh_cpp"
    assert finding.severity is Severity.ERROR
    assert examination.plan is None


def test_a_driver_gets_absolute_paths(tmp_path):
    (tmp_path / "moves.csv").write_text("time_s,joint_1,joint_2\n0,0,0\n")
    path = teleoperation(tmp_path)
    override = 'robot.actions[1].mock_motor_config.motion_file="moves.csv"'
    plan = examine(Request(path, overrides=(override,))).plan
    (leader,) = (node for node in plan.nodes if node.name == "leader")
    assert leader.settings["motion_file"] == str(tmp_path / "moves.csv")


def test_waivers_reach_the_actuators(tmp_path):
    path = teleoperation(tmp_path)
    (leader, _) = examine(Request(path)).plan.nodes
    assert not leader.facts.allow_uncalibrated
    (leader, follower) = examine(Request(path, allow_uncalibrated=True, dry_run=True)).plan.nodes
    assert leader.facts.allow_uncalibrated is True
    assert follower.facts.dry_run is True


def test_a_test_moves_actuators_that_have_no_calibration(tmp_path):
    path = teleoperation(tmp_path, general=GENERAL.replace("MODE_TELEOPERATE", "MODE_TEST"))
    (leader, _) = examine(Request(path)).plan.nodes
    assert leader.facts.allow_uncalibrated is True


@pytest.mark.parametrize(("kind", "notes"), [("TRANSPORT_ZENOH", 1), ("TRANSPORT_DDS", 0)])
def test_settings_that_do_not_act_everywhere_are_noted_once(tmp_path, kind, notes):
    path = teleoperation(tmp_path, f"transport {{ kind: {kind} }}")
    text = Path(path).read_text().replace("qos { depth: 3 }", "qos { depth: 3 lifespan_s: 0.5 }")
    Path(path).write_text(text)
    found = [item for item in examine(Request(path)).diagnostics if item.code == "qos-acts-partly"]
    assert len(found) == notes
    for item in found:
        assert item.severity is Severity.NOTE
        assert item.message.startswith("/follower/joint_states, /leader/joint_states: lifespan acts between")


def test_a_missing_transport_names_its_plugin(tmp_path):
    path = teleoperation(tmp_path, "transport { kind: TRANSPORT_DDS }")
    blocked = ("joshua-dds",)
    examination = examine(Request(path, blocked_plugins=blocked))
    (finding,) = [item for item in examination.diagnostics if item.code == "extra-missing"]
    assert finding.severity is Severity.NOTE
    assert "TRANSPORT_DDS requires the plugin joshua-dds, which is blocked" in finding.message
    assert "or choose TRANSPORT_ZENOH" in finding.remedy
    launch = examine(Request(path, purpose=Purpose.LAUNCH, blocked_plugins=blocked))
    assert ("extra-missing", Severity.ERROR) in codes(launch)
    assert launch.plan is None


def test_nodes_without_a_native_implementation_are_noted_once_at_launch(tmp_path):
    path = teleoperation(tmp_path)
    Path(path).write_text(Path(path).read_text().replace("node_type: PYTHON", "node_type: CPP"))
    assert "native-missing" not in [item.code for item in examine(Request(path)).diagnostics]
    found = examine(Request(path, purpose=Purpose.LAUNCH)).diagnostics
    (finding,) = [item for item in found if item.code == "native-missing"]
    assert finding.message == (
        "joshua-mock has no native implementation of follower, leader: the Python implementation runs."
    )


@pytest.mark.parametrize(
    ("rmw", "block", "field"),
    [
        ("rmw_cyclonedds_cpp", 'listen_endpoints: "tcp/localhost:7447"', "listen_endpoints"),
        ("", 'network_interface: "eth0"', "network_interface"),
    ],
)
def test_what_the_chosen_middleware_does_not_use_is_refused(tmp_path, monkeypatch, rmw, block, field):
    monkeypatch.setenv("RMW_IMPLEMENTATION", rmw)
    path = teleoperation(tmp_path, f"transport {{ {block} }}")
    found = [item for item in examine(Request(path)).diagnostics if item.code == "transport-field-unused"]
    assert found[0].field_path == f"transport.{field}"
    assert found[0].remedy.startswith("Write kind: TRANSPORT_")
    assert found[0].severity is Severity.ERROR


def test_relative_paths_start_at_the_file_that_names_them(tmp_path, monkeypatch):
    (tmp_path / "net").mkdir()
    tls = 'root_ca_file: "ca.pem" certificate_file: "a.pem" private_key_file: "a.key"'
    net = f'transport {{ kind: TRANSPORT_ZENOH listen_endpoints: "tls/localhost:7447" tls {{ {tls} }} }}'
    (tmp_path / "net" / "net.pbtxt").write_text(net)
    for name in ("ca.pem", "a.pem", "a.key"):
        (tmp_path / "net" / name).write_text("")
    monkeypatch.chdir("/")
    path = teleoperation(tmp_path, 'include: "net/net.pbtxt"')
    Path(path).write_text(
        Path(path).read_text().replace("node_id: 1", 'node_id: 1 python: "venv/bin/python"')
    )

    examination = examine(Request(str(path)))
    assert examination.plan.transport.tls.root_ca_file == str(tmp_path / "net" / "ca.pem")
    interpreters = {node.name: node.interpreter for node in examination.plan.nodes}
    assert interpreters == {"leader": str(tmp_path / "venv" / "bin" / "python"), "follower": ""}
