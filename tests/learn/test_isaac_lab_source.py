"""Isaac Lab as its own source declares it: what lab.py names exists there and takes what it is given."""

from __future__ import annotations

import ast
import importlib.util
from functools import cache
from pathlib import Path

import joshua_isaac_trainer
from joshua_isaac_trainer import scene
from joshua_isaac_trainer.settings import TASKS
from joshua_isaac_trainer.tasks import TensorTask


def lab_source() -> Path:
    spec = importlib.util.find_spec("isaaclab")
    assert spec is not None
    assert spec.submodule_search_locations
    return Path(next(iter(spec.submodule_search_locations))) / "source"


@cache
def lab_classes() -> dict[str, list[ast.ClassDef]]:
    folder = lab_source() / "isaaclab" / "isaaclab"
    parts = ("actuators", "assets", "envs", "managers", "scene", "sim")
    paths = {path for part in parts for path in (folder / part).rglob("*_cfg.py")}
    named = (
        *("assets/articulation/articulation", "assets/articulation/articulation_data"),
        *("assets/rigid_object/rigid_object", "assets/rigid_object/rigid_object_data"),
        *("envs/mdp/events", "managers/action_manager", "managers/termination_manager"),
        "scene/interactive_scene",
    )
    return classes([*sorted(paths), *(folder / f"{name}.py" for name in named)])


def classes(paths: list[Path]) -> dict[str, list[ast.ClassDef]]:
    found: dict[str, list[ast.ClassDef]] = {}
    for path in paths:
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ClassDef):
                found.setdefault(node.name, []).append(node)
    return found


def fields(known: dict[str, list[ast.ClassDef]], name: str) -> set[str]:
    found: set[str] = set()
    for node in known[name]:
        for item in node.body:
            targets = item.targets if isinstance(item, ast.Assign) else [getattr(item, "target", None)]
            found |= {target.id for target in targets if isinstance(target, ast.Name)}
        bases = [base.id if isinstance(base, ast.Name) else getattr(base, "attr", "") for base in node.bases]
        found = found.union(*(fields(known, base) for base in bases if base in known and base != name))
    return found


def test_isaac_lab_has_the_fields_that_the_task_sets() -> None:
    known = lab_classes()
    source = Path(joshua_isaac_trainer.__file__).with_name("lab.py").read_text(encoding="utf-8")
    checked = set()
    for call in ast.walk(ast.parse(source)):
        if not isinstance(call, ast.Call):
            continue
        name = call.func.attr if isinstance(call.func, ast.Attribute) else getattr(call.func, "id", "")
        if not name.endswith("Cfg") or name not in known:
            assert not name.endswith("Cfg") or name == "TaskActionCfg", name
            continue
        wanted = {keyword.arg for keyword in call.keywords if keyword.arg}
        assert wanted <= fields(known, name), (name, wanted - fields(known, name))
        checked.add(name)
    assert {"ArticulationCfg", "ImplicitActuatorCfg", "UrdfConverterCfg", "ManagerBasedRLEnvCfg"} <= checked
    for owner, wanted in (
        ("ManagerBasedRLEnvCfg", {"seed", "decimation", "episode_length_s", "sim", "scene", "actions"}),
        ("ManagerBasedRLEnvCfg", {"observations", "rewards", "terminations", "events"}),
        ("CuboidCfg", {"rigid_props", "mass_props"}),
    ):
        assert wanted <= fields(known, owner)


def test_isaac_lab_has_the_methods_that_the_task_calls() -> None:
    known = lab_classes()

    def methods(name: str) -> dict[str, list[str]]:
        return {
            item.name: [argument.arg for argument in (*item.args.args, *item.args.kwonlyargs)]
            for node in known[name]
            for item in node.body
            if isinstance(item, ast.FunctionDef)
        }

    articulation = methods("Articulation")
    assert {"joint_ids", "env_ids"} <= set(articulation["set_joint_position_target"])
    assert {"joint_ids", "env_ids"} <= set(articulation["write_joint_state_to_sim"])
    assert "preserve_order" in articulation["find_joints"]
    assert "find_bodies" in articulation
    assert {"joint_pos", "joint_vel", "body_link_pos_w", "body_link_quat_w"} <= methods(
        "ArticulationData"
    ).keys()
    assert {"root_link_pos_w", "root_link_quat_w", "root_link_vel_w"} <= methods("RigidObjectData").keys()
    assert {"write_root_link_pose_to_sim", "write_root_com_velocity_to_sim"} <= methods("RigidObject").keys()
    assert {"env_origins", "rigid_objects", "__getitem__"} <= methods("InteractiveScene").keys()
    assert "get_term" in methods("ActionManager")
    assert "get_term" in methods("TerminationManager")
    assert {"process_actions", "apply_actions", "raw_actions", "processed_actions"} <= methods(
        "ActionTerm"
    ).keys()
    for event in (e for t in map(TensorTask, TASKS) for e in scene.randomisation(t.task, t.model).values()):
        assert {"asset_cfg", *event.parameters} <= set(methods(event.function)["__call__"])
        assert {"name", *event.parts} <= fields(known, "SceneEntityCfg")
    rl = classes([*(lab_source() / "isaaclab_rl/isaaclab_rl/rsl_rl").glob("*.py")])
    wrapper = {item.name for item in rl["RslRlVecEnvWrapper"][0].body if isinstance(item, ast.FunctionDef)}
    assert {"step", "get_observations", "unwrapped"} <= wrapper


def test_rewards_have_the_weight_of_a_step_in_isaac_lab() -> None:
    text = (lab_source() / "isaaclab/isaaclab/managers/reward_manager.py").read_text(encoding="utf-8")
    assert "term_cfg.weight * dt" in text  # which lab.py divides by
