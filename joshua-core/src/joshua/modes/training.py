"""MODE_TRAINING: a training block, its data set, and a robot if training uses one."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from joshua.config.checks import Context
from joshua.modes import inference
from joshua.modes.queries import lacks
from joshua.modes.services import SIMULATION, TRAINING, awaits_weights, judges_robot
from joshua.modes.spec import ModeSpec
from joshua.plan import Diagnostic
from joshua.schema import config_pb2 as pb


def check(context: Context) -> Iterator[Diagnostic]:
    """Require what the chosen method and environment need."""
    ai = context.config.ai
    if not ai.HasField("training"):
        what = "the block ai.training, which says what is trained and how"
        remedy = (
            "Add ai { training { environment: ... method: ... } }; "
            "`joshua explain ai.training` lists its fields"
        )
        yield lacks(context, "mode-lacks-block", what, "ai.training", remedy=remedy)
        return
    if judges_robot(context.config):
        yield from inference.check(context)
        yield from _judged_weights(context)
    yield from _data_set(context)
    if ai.training.environment_id and (
        ai.training.environment == pb.ENV_REAL or ai.training.method == pb.METHOD_IMITATION
    ):
        path = "ai.training.environment_id"
        message = "environment_id has no effect here: it applies to simulated environments, not to data sets"
        remedy = "Remove it, or set environment: ENV_SIMULATION with METHOD_RL or METHOD_EVAL"
        yield context.note("block-unused", message, path, remedy=remedy)


def _data_set(context: Context) -> Iterator[Diagnostic]:
    """With imitation learning, the data store locates the data set."""
    ai = context.config.ai
    wanted, stored = ai.training.imitation_config.dataset_name, ai.data_store.dataset_name
    if ai.training.method != pb.METHOD_IMITATION or not wanted or not stored or wanted == stored:
        return
    path = "ai.training.imitation_config.dataset_name"
    message = f"The data store of the training contains {stored}, not {wanted}"
    related = context.see("ai.data_store.dataset_name", "data set of the store")
    yield context.error("dataset-mismatch", message, path, allowed=(f'"{stored}"',), related=related)


def _judged_weights(context: Context) -> Iterator[Diagnostic]:
    """On the robot, a model of ``ai.models`` runs the weights that are evaluated."""
    block = context.config.ai.training.eval_config
    known = [entry.owner.pretrained_model_name_or_path for entry in context.graph.models]
    if awaits_weights(context.config) and any(known):
        entry = next(entry for entry in context.graph.models if entry.owner.pretrained_model_name_or_path)
        path = f"{entry.owner_path}.pretrained_model_name_or_path"
        remedy = "Remove it; `pretrained` in imitation_config names weights that the training starts from"
        yield context.error("checkpoint-not-run", "The training provides the weights", path, remedy=remedy)
        return
    if block.camera and not context.graph.pictures(block.camera):
        names = dict.fromkeys(item.entry.node.node_name for item in context.graph.pictures())
        message = f"No node {block.camera} publishes pictures"
        path = "ai.training.eval_config.camera"
        yield context.error("invalid-setting", message, path, allowed=tuple(names)[:50])
    wanted = block.model_checkpoint
    if wanted and any(known) and wanted not in known:
        path = "ai.training.eval_config.model_checkpoint"
        message = f"No model of ai.models runs {wanted}, and on a robot a model runs the weights"
        allowed = tuple(f'"{name}"' for name in known if name)
        yield context.error("checkpoint-not-run", message, path, allowed=allowed)


def _for_file(spec: ModeSpec, config: pb.Config) -> ModeSpec:
    on_robot, judged = config.ai.training.environment == pb.ENV_REAL, judges_robot(config)
    services = (*spec.services, SIMULATION) if judged else spec.services  # of simulated arms
    return replace(spec, devices=on_robot, models=judged, services=services)


SPEC = ModeSpec(
    "MODE_TRAINING",
    check,
    devices=False,
    services=(TRAINING.needed(),),
    # a data set is read, a policy evaluated, an environment seeded
    blocks=("ai.data_store", "ai.models", "simulation"),
    for_file=_for_file,
    idle="training in simulation",
)
