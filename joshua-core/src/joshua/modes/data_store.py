"""MODE_DATA_STORE: episodes are recorded, uploaded or replayed."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from joshua.config.checks import Context
from joshua.modes.queries import lacks
from joshua.modes.services import DATA_STORE, SIMULATION
from joshua.modes.spec import ModeSpec
from joshua.plan import Diagnostic
from joshua.schema import config_pb2 as pb

_STORE = "ai.data_store"


def check(context: Context) -> Iterator[Diagnostic]:
    """Require the store and what its operation works on."""
    if not context.config.ai.HasField("data_store"):
        what = "the block ai.data_store, which says where episodes are stored"
        remedy = (
            "Add ai { data_store { format: FORMAT_HUGGINGFACE storage: STORAGE_LOCAL "
            "dataset_name: ... local_path: ... } }"
        )
        yield lacks(context, "mode-lacks-block", what, _STORE, remedy=remedy)
        return
    store = context.config.ai.data_store
    if store.operation == pb.DATA_STORE_UPLOAD:
        yield from _upload(context, store)
    elif store.operation == pb.DATA_STORE_REPLAY:
        yield from _replay(context, store)
    else:
        yield from _record(context, store)


def _record(context: Context, store: pb.DataStore) -> Iterator[Diagnostic]:
    if store.storage == pb.STORAGE_LOCAL and not store.local_path:
        yield _lacks_path(context, "Recording to this machine")
    if not any(item.is_publisher for item in context.graph.usable):
        what = "topics to record, but no node of this file publishes any"
        remedy = "Add the robot's actuators and cameras with their publishers"
        yield lacks(context, "mode-lacks-publisher", what, "robot", remedy=remedy)


def _upload(context: Context, store: pb.DataStore) -> Iterator[Diagnostic]:
    if not store.local_path:
        yield _lacks_path(context, "An upload")
    if not store.remote_url:
        message = "An upload needs remote_url, the destination of the data set"
        remedy = 'Add remote_url: "hf://datasets/my-name/my-data"'
        yield context.error("mode-lacks-field", message, f"{_STORE}.remote_url", remedy=remedy)


def _replay(context: Context, store: pb.DataStore) -> Iterator[Diagnostic]:
    if not store.local_path and not store.remote_url:
        yield _lacks_path(context, "A replay")
    if not any(context.graph.commands(entry) for entry in context.graph.actuators):
        what = "an actuator to replay on that takes commands from a topic"
        remedy = "Add an actions block whose node subscribes to a JOINT_STATE topic"
        yield lacks(context, "mode-lacks-actuator", what, "robot.actions", remedy=remedy)


def _lacks_path(context: Context, what: str) -> Diagnostic:
    message = f"{what} needs local_path, the folder of the data set"
    remedy = 'Add local_path: "datasets/my_data"'
    return context.error("mode-lacks-field", message, f"{_STORE}.local_path", remedy=remedy)


def _for_file(spec: ModeSpec, config: pb.Config) -> ModeSpec:
    """An upload needs no robot, real or simulated."""
    if config.ai.data_store.operation != pb.DATA_STORE_UPLOAD:
        return spec
    service = replace(DATA_STORE.needed(), restart="stop-run")
    return replace(spec, devices=False, services=(service,), blocks=("simulation",), idle="an upload")


SPEC = ModeSpec("MODE_DATA_STORE", check, services=(DATA_STORE.needed(), SIMULATION), for_file=_for_file)
