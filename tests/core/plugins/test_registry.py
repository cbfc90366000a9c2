from __future__ import annotations

from dataclasses import replace

import pytest
from joshua.plugins import (
    ActuatorSpec,
    Environment,
    EnvironmentSpec,
    EpisodeWriterSpec,
    ModelSpec,
    PluginRow,
    PluginSpec,
    PluginStatus,
    Registry,
    SensorSpec,
    StoreSpec,
    TrainerSpec,
)

LIDAR = SensorSpec(block="lidar_config", implementation="a:B", enum_values=("PERCEPTION_LIDAR",))
CAMERA = SensorSpec(block="camera_config", implementation="a:C", enum_values=("PERCEPTION_CAMERA",))
SMOLVLA = ModelSpec(block="", implementation="a:Smol", enum_values=("SMOLVLA",))


@pytest.fixture(autouse=True)
def _from_a_package(monkeypatch: pytest.MonkeyPatch) -> None:
    """The core is installed from a package, so that plugins are named by their distribution."""
    monkeypatch.setattr("joshua.plan.installing.clone", lambda: None)
    monkeypatch.setattr("joshua.plan.installing.origin", lambda *_: "")


def row(distribution: str, *specs: PluginSpec, status: PluginStatus = PluginStatus.OK) -> PluginRow:
    return PluginRow(
        name=distribution.removeprefix("joshua-"),
        distribution=distribution,
        version="1",
        status=status,
        reasons=("no module named cv2",) if status is PluginStatus.BROKEN else (),
        specs=specs,
    )


def absent(plugin: str) -> str:
    return f"the plugin {plugin}, which is not installed: pip install {plugin}"


REACH = Environment("acme/Reach-v0", ("reach",))
PUSH = Environment("acme/Push-v0", ("push",))
TASKS = EnvironmentSpec(
    block="training",
    implementation="a:make",
    enum_values=("BACKEND_MJX",),
    environments=(REACH, PUSH),
)


def test_several_plugins_may_offer_environments_of_different_names() -> None:
    other = TASKS.replace(implementation="x:make", environments=(Environment("b/Reach-v0", ("reach",)),))
    registry = Registry((row("acme-one", TASKS), row("acme-two", other)))
    assert [found.id for found, _ in registry.environments()] == [
        "acme/Reach-v0",
        "acme/Push-v0",
        "b/Reach-v0",
    ]
    assert registry.environments("BACKEND_ISAAC") == ()
    assert {offer.implementation for _, offer in registry.environments("BACKEND_MJX")} == {"a:make", "x:make"}
    same = Registry((row("acme-one", TASKS), row("acme-two", TASKS.replace(environments=(PUSH,)))))
    assert same.environments() == ()
    assert "both provide acme/Push-v0 with training" in same.rows()[0].reasons[0]


def test_installed_plugin_that_lacks_something_is_not_to_be_installed() -> None:
    registry = Registry((row("joshua-lidar"),))
    assert registry.missing("front", SensorSpec, "lidar_config", "PERCEPTION_LIDAR") == (
        "front: PERCEPTION_LIDAR requires the plugin joshua-lidar, and 1 does not provide it: "
        "pip install --upgrade joshua-lidar"
    )


def test_two_plugins_for_the_same_block_are_a_conflict_that_names_both() -> None:
    registry = Registry(
        (row("acme-one", LIDAR, CAMERA), row("acme-two", LIDAR.replace(implementation="x:Y")))
    )
    assert registry.find(SensorSpec, "lidar_config", "PERCEPTION_LIDAR") is None
    assert registry.find(SensorSpec, "camera_config", "PERCEPTION_CAMERA") is CAMERA
    expected = (
        "acme-one and acme-two both provide PERCEPTION_LIDAR with lidar_config; neither is used for it: "
        "choose with --block-plugin acme-one or --block-plugin acme-two"
    )
    for conflicting in registry.rows():
        assert conflicting.status is PluginStatus.CONFLICT
        assert conflicting.reasons == (expected,)
    text = registry.missing("front", SensorSpec, "lidar_config", "PERCEPTION_LIDAR")
    assert text == f"front: two plugins provide PERCEPTION_LIDAR: {expected}"


def test_a_conflict_elsewhere_is_not_named() -> None:
    registry = Registry(
        (row("acme-one", LIDAR, CAMERA), row("acme-two", LIDAR.replace(implementation="x:Y")))
    )
    text = registry.missing("top", SensorSpec, "camera_config", "PERCEPTION_LIDAR")
    assert text == "top: acme-one provides camera_config for PERCEPTION_CAMERA, not for PERCEPTION_LIDAR"


def test_a_conflict_of_models_is_named_though_they_have_no_block() -> None:
    registry = Registry((row("acme-one", SMOLVLA), row("acme-two", SMOLVLA.replace(implementation="x:Y"))))
    assert registry.find(ModelSpec, "", "SMOLVLA") is None
    assert registry.missing("policy", ModelSpec, "", "SMOLVLA").startswith(
        "policy: two plugins provide SMOLVLA: acme-one and acme-two both provide SMOLVLA; neither"
    )


def test_two_entry_points_of_one_package_are_told_apart() -> None:
    first, second = row("acme", LIDAR), row("acme", LIDAR.replace(implementation="x:Y"))
    registry = Registry((replace(first, name="old"), replace(second, name="new")))
    assert registry.rows()[0].reasons == (
        "old and new both provide PERCEPTION_LIDAR with lidar_config; neither is used for it: "
        "choose with --block-plugin old or --block-plugin new",
    )


def test_an_open_spec_conflicts_with_a_specific_one() -> None:
    registry = Registry((row("acme-one", LIDAR), row("acme-two", LIDAR.replace(enum_values=()))))
    assert registry.find(SensorSpec, "lidar_config", "PERCEPTION_LIDAR") is None


def test_nobody_displaces_the_core() -> None:
    registry = Registry((row("joshua-core", LIDAR), row("acme-two", LIDAR.replace(implementation="x:Y"))))
    assert registry.find(SensorSpec, "lidar_config", "PERCEPTION_LIDAR") is LIDAR
    assert [r.status for r in registry.rows()] == [PluginStatus.OK, PluginStatus.CONFLICT]
    assert registry.rows()[1].reasons == (
        "acme-two and joshua-core both provide PERCEPTION_LIDAR with lidar_config; joshua-core is used",
    )


def test_different_enum_values_of_one_block_live_together() -> None:
    follower = ActuatorSpec(
        block="sts3215_config",
        implementation="a:B",
        enum_values=("ACTION_FOLLOWER",),
    )
    leader = follower.replace(enum_values=("ACTION_LEADER",), implementation="c:D")
    registry = Registry((row("acme-one", follower), row("acme-two", leader)))
    assert registry.find(ActuatorSpec, "sts3215_config", "ACTION_LEADER") is leader
    assert registry.find(ActuatorSpec, "sts3215_config", "ACTION_FOLLOWER") is follower
    assert registry.find(ActuatorSpec, "sts3215_config") is None


def test_an_enum_value_alone_decides_where_there_is_no_block() -> None:
    noise = ModelSpec(
        block="random_noise_config",
        implementation="n:N",
        enum_values=("RANDOM_NOISE",),
    )
    registry = Registry((row("acme-one", SMOLVLA, noise),))
    assert registry.find(ModelSpec, "", "SMOLVLA") is SMOLVLA
    assert registry.find(ModelSpec, "random_noise_config", "RANDOM_NOISE") is noise
    assert registry.find(ModelSpec, "", "RANDOM_NOISE") is noise


@pytest.mark.parametrize(
    ("kind", "block", "enum_value", "sentence"),
    [
        (
            SensorSpec,
            "lidar_config",
            "PERCEPTION_LIDAR",
            f"n: PERCEPTION_LIDAR requires {absent('joshua-lidar')}",
        ),
        (
            ActuatorSpec,
            "sts3215_config",
            "ACTION_FOLLOWER",
            f"n: ACTION_FOLLOWER with sts3215_config requires {absent('joshua-sts3215')}",
        ),
        (
            ModelSpec,
            "",
            "SMOLVLA",
            f"n: SMOLVLA requires {absent('joshua-smolvla')}",
        ),
        (
            TrainerSpec,
            "rl_config",
            "BACKEND_MJX",
            f"n: BACKEND_MJX requires {absent('joshua-mjx-trainer')}",
        ),
        (
            TrainerSpec,
            "rl_config",
            "METHOD_RL",
            f"n: METHOD_RL requires {absent('joshua-ppo-trainer')}",
        ),
        (
            StoreSpec,
            "data_store",
            "FORMAT_PARQUET",
            f"n: FORMAT_PARQUET requires {absent('joshua-dataset')}",
        ),
        (
            EpisodeWriterSpec,
            "data_store",
            "FORMAT_HUGGINGFACE",
            f"n: FORMAT_HUGGINGFACE requires {absent('joshua-dataset')}",
        ),
        (
            ActuatorSpec,
            "acme.GripperConfig",
            "ACTION_PLUGIN",
            "n: ACTION_PLUGIN with acme.GripperConfig requires a plugin that provides it, "
            "and none is installed: install the vendor's package, then run joshua plugins",
        ),
    ],
)
def test_a_missing_plugin_is_named_with_its_remedy(
    kind: type[PluginSpec], block: str, enum_value: str, sentence: str
) -> None:
    assert Registry(()).missing("n", kind, block, enum_value) == sentence


def test_a_blocked_or_broken_plugin_is_not_to_be_installed_again() -> None:
    ask = ("front", SensorSpec, "lidar_config", "PERCEPTION_LIDAR")
    assert Registry((row("joshua-lidar", status=PluginStatus.BLOCKED),)).missing(*ask) == (
        "front: PERCEPTION_LIDAR requires the plugin joshua-lidar, which is blocked: "
        "leave out --block-plugin lidar"
    )
    assert Registry((row("joshua-lidar", status=PluginStatus.BROKEN),)).missing(*ask) == (
        "front: PERCEPTION_LIDAR requires the plugin joshua-lidar, which is broken (no module named cv2): "
        "pip install --force-reinstall joshua-lidar"
    )
    remedies = [
        Registry(rows).remedy(*ask[1:])
        for rows in (
            (),
            (row("joshua-lidar", status=PluginStatus.BLOCKED),),
            (row("joshua-lidar", status=PluginStatus.BROKEN),),
        )
    ]
    assert [text.split(",")[0] for text in remedies] == [
        "install the plugin",
        "leave --block-plugin out",
        "run `joshua plugins` to see why it is not used",
    ]


def test_a_third_partys_plugin_that_is_not_in_use_is_named() -> None:
    rows = (row("acme-gripper", status=PluginStatus.BLOCKED), row("acme-arm", status=PluginStatus.BROKEN))
    text = Registry(rows).missing("hand", ActuatorSpec, "acme.GripperConfig", "ACTION_PLUGIN")
    assert text == (
        "hand: ACTION_PLUGIN with acme.GripperConfig requires a plugin that provides it, "
        "and no plugin in use does (acme-gripper is blocked, acme-arm is broken): see joshua plugins"
    )


def test_a_block_whose_plugin_does_not_take_the_enum_value() -> None:
    spike = ActuatorSpec(
        block="spike_motor_config",
        implementation="a:B",
        enum_values=("ACTION_SPIKE", "ACTION_SINGLE"),
    )
    text = Registry((row("joshua-spike", spike),)).missing(
        "hub", ActuatorSpec, "spike_motor_config", "ACTION_LEADER"
    )
    assert text == (
        "hub: joshua-spike provides spike_motor_config for ACTION_SPIKE, ACTION_SINGLE, not for ACTION_LEADER"
    )
    remedy = Registry((row("joshua-spike", spike),)).remedy(
        ActuatorSpec, "spike_motor_config", "ACTION_LEADER"
    )
    assert remedy == "use one of these types, or another block"


def test_a_spec_of_another_registry_has_no_owner() -> None:
    with pytest.raises(KeyError, match="is not of this registry"):
        Registry(()).owner(LIDAR)
