"""Files that a run reads: whether they exist, and where they were searched."""

from __future__ import annotations

import os
import re
import stat
from collections.abc import Callable, Iterator
from pathlib import Path

from joshua.config.checks.context import Context
from joshua.config.checks.fit import METHOD_BLOCKS
from joshua.config.input_paths import folder_of
from joshua.config.loading import LoadedConfig
from joshua.plan import Diagnostic
from joshua.plan.lfs import describe_pointer
from joshua.schema import config_pb2 as pb
from joshua.schema import options_pb2 as rules
from joshua.schema import simulation_pb2, transport_pb2
from joshua.textproto.field_facts import FieldFacts

# A hub id is "owner/name". A text that starts with a dot, a slash or ~ is always a path.
_HUB_ID = r"[A-Za-z0-9][\w.-]*/[A-Za-z0-9][\w.-]*"
_WEIGHT_SUFFIXES = (".pt", ".pth", ".ckpt", ".zip", ".safetensors", ".onnx", ".npz", ".msgpack")
_FOLDER_NAMES = ("checkpoints", "models", "outputs", "policies", "runs", "weights")
_LABELS = {
    "model_path": "model of the simulation",
    "motion_file": "motion file",
    "root_ca_file": "certificate of the authority",
    "certificate_file": "certificate",
    "private_key_file": "private key",
}


#: Kinds of fields whose value may be the path of a file or a folder.
_PLACES = frozenset(
    (
        rules.KIND_INPUT_FILE,
        rules.KIND_SOURCE,
        rules.KIND_MODEL,
        rules.KIND_INTERPRETER,
        rules.KIND_OUTPUT_PATH,
    )
)
_TRAIN_THEM = (
    "Correct the path, or train a policy first: `joshua new train --from training_rl_ppo` writes the file "
    "of a training, whose log names the folder of its run"
)
_PUT_IT_THERE = "Correct the path or put the file there"

# These return False for a name that the system refuses, such as a long one.
_exists, _is_file, _is_folder = os.path.exists, os.path.isfile, os.path.isdir


def check_paths(
    loaded: LoadedConfig,
    launch: bool,
    *,
    host: str = "",
    is_packaged: Callable[[str], bool | None] = lambda name: None,
    packaged_weights: Callable[[str], Path | None] = lambda name: None,
) -> list[Diagnostic]:
    """Check that every input file of the configuration exists.

    Args:
        loaded: the result of ``joshua.config.load``.
        launch: whether nodes will be started. A missing file is then an error, else a note.
        host: this machine's name in the file. Files of other machines' nodes are skipped.
        is_packaged: tells whether an installed plugin provides a simulation model of this name. None if no
            simulator is installed; an unknown name is then only a note.
        packaged_weights: finds weights of this name that ship with an installed plugin.
    """
    context = Context(loaded, launch=launch)
    owners = {entry.owner_path: entry.node.host for entry in context.graph.entries}

    def counts(path: str) -> bool:
        """Whether this run reads the files of a block: the block has an effect, and its node runs here."""
        config = context.config
        if path == "transport.tls" and config.transport.kind == transport_pb2.TRANSPORT_DDS:
            return False
        if path.startswith("ai.training") and not _is_trained(config, path):
            return False
        if path == "simulation" and config.general.mode not in (pb.MODE_SIMULATION, pb.MODE_TRAINING):
            return False  # the simulator's settings report it, if it runs beside the mode
        return not host or owners.get(".".join(path.split(".")[:2]), "") in ("", host)

    found: list[Diagnostic] = []
    for block in context.blocks:
        for facts in block.facts if counts(block.path) else ():
            if facts.kind not in _PLACES or facts.repeated:
                continue
            value = getattr(block.message, facts.name)
            if facts.kind == rules.KIND_MODEL and packaged_weights(value) is not None:
                continue
            if value and len(value) < 4096 and "\0" not in value:
                found += _field(context, facts, block.field_path(facts.name), value, is_packaged)
    return [*found, *_data_sets(context)]


def _field(
    context: Context, facts: FieldFacts, path: str, value: str, is_packaged: Callable[[str], bool | None]
) -> Iterator[Diagnostic]:
    place = _place(context, path, value)
    if facts.name == "model_path" and facts.kind == rules.KIND_INPUT_FILE:
        yield from _packaged_model(context, path, place, is_packaged(value))
    elif facts.kind == rules.KIND_INPUT_FILE:
        yield from _input_file(context, path, place, _LABELS.get(facts.name, facts.name.replace("_", " ")))
        if facts.name == "private_key_file":
            yield from _private_key(context, path, place)
    elif facts.kind == rules.KIND_SOURCE and facts.named_by(value)[0] == rules.NAMES_FILE:
        yield from _input_file(context, path, place, "video file")
    elif facts.kind == rules.KIND_MODEL and not _exists(place) and not _is_hub_id(context, path, value):
        # Nothing about a policy can be checked without its weights, so this file is not valid here.
        message = f"The weights do not exist: looked for {place}"
        remedy = _TRAIN_THEM if path.startswith("ai.training.eval_config") else ""
        yield context.error("weights-not-found", message, path, remedy=remedy)
    elif facts.kind == rules.KIND_INTERPRETER and not (_is_file(place) and os.access(place, os.X_OK)):
        message = f"The Python interpreter of this node does not exist or cannot be run: looked for {place}"
        yield context.missing("interpreter-missing", message, path)
    elif facts.kind == rules.KIND_OUTPUT_PATH and _is_file(place):
        remedy = f"Choose another path, or move {place} away"
        yield context.missing(
            "output-path-is-file", f"{value} is a file, but this must be a folder", path, remedy=remedy
        )


def _is_trained(config: pb.Config, path: str) -> bool:
    """Whether a training runs, and its method is the one whose parameters a block holds."""
    if config.general.mode != pb.MODE_TRAINING:
        return False
    name = path.removeprefix("ai.training").removeprefix(".").partition(".")[0]
    method = METHOD_BLOCKS.get(config.ai.training.method, name)
    return name not in METHOD_BLOCKS.values() or name in (method, "plugin_config")


def _packaged_model(context: Context, path: str, place: Path, packaged: bool | None) -> Iterator[Diagnostic]:
    label = _LABELS["model_path"]
    if packaged is None and not _exists(place):
        message = (
            f"The {label} does not exist (looked for {place}). The simulator's plugin may bring a model of "
            "this name, but it is not installed"
        )
        remedy = "Install the plugin, or correct the path"
        yield context.note("input-file-missing", message, path, remedy=remedy)
    elif not packaged:
        extra = ", and no installed simulator brings a model of this name"
        remedy = f"{_PUT_IT_THERE}; the simulator's plugin brings models such as so_arm100/scene.xml"
        yield from _input_file(context, path, place, label, extra, remedy)


def _input_file(
    context: Context, path: str, place: Path, label: str, extra: str = "", remedy: str = _PUT_IT_THERE
) -> Iterator[Diagnostic]:
    if _is_folder(place):
        message = f"The {label} is a folder, but a file is required"
        yield context.missing("input-file-is-folder", message, path, remedy=f"Name a file in {place}")
    elif not _exists(place):
        message = f"The {label} does not exist: looked for {place}{extra}"
        yield context.missing("input-file-missing", message, path, remedy=remedy)
    elif not os.access(place, os.R_OK):
        message = f"This user may not read the {label}"
        remedy = f"Change the permissions of {place}"
        yield context.missing("input-file-unreadable", message, path, remedy=remedy)
    elif (pointer := describe_pointer(place)) is not None:
        message, remedy = pointer
        yield context.missing("input-file-is-pointer", message, path, remedy=remedy)


def _private_key(context: Context, path: str, place: Path) -> Iterator[Diagnostic]:
    try:
        mode = place.stat().st_mode
    except OSError:  # reported as missing
        return
    if stat.S_ISREG(mode) and mode & stat.S_IROTH:
        yield context.warning(
            "private-key-readable",
            f"Every user of this machine can read the private key and command the robot with it: {place} has "
            f"mode {stat.S_IMODE(mode):04o}",
            path,
            remedy=f"Run chmod 600 {place}",
        )


def _is_hub_id(context: Context, path: str, value: str) -> bool:
    """Distinguish ``lerobot/smolvla_base`` from ``checkpoints/policy``, which look alike."""
    folder = value.partition("/")[0]
    return (
        re.fullmatch(_HUB_ID, value) is not None
        and not value.endswith(_WEIGHT_SUFFIXES)
        and folder not in _FOLDER_NAMES
        and not _is_folder(_place(context, path, folder))
    )


def _data_sets(context: Context) -> Iterator[Diagnostic]:
    """Check the data sets that the mode reads, and one that it would overwrite."""
    config, mode, simulation = context.config, context.config.general.mode, context.config.simulation
    store, path = config.ai.data_store, "ai.data_store.local_path"
    place = _place(context, path, store.local_path)
    purpose = ""
    if mode == pb.MODE_DATA_STORE:
        purpose = {pb.DATA_STORE_UPLOAD: "upload", pb.DATA_STORE_REPLAY: "replay"}.get(store.operation, "")
    elif mode == pb.MODE_SIMULATION:
        purpose = "replay" if simulation.mode == simulation_pb2.PASSIVE else ""
        recording = _place(context, "simulation.trajectory_path", simulation.trajectory_path)
        if simulation.trajectory_path and not _exists(recording):
            message = f"The recording does not exist: looked for {recording}"
            remedy = "Correct the path, or put the file or the folder of the data set there"
            yield context.missing("input-file-missing", message, "simulation.trajectory_path", remedy=remedy)
        is_full = simulation.HasField("generate") and bool(store.local_path) and _is_folder(place)
        if is_full and any(place.iterdir()):
            message = f"The folder {place} is not empty, and a data set is never overwritten"
            yield context.missing("dataset-exists", message, path)
    elif mode == pb.MODE_TRAINING and config.ai.training.method == pb.METHOD_IMITATION:
        name = config.ai.training.imitation_config.dataset_name
        purpose = "train on" if name else ""
        own = "ai.training.imitation_config.dataset_name"
        is_remote = "://" in name or re.fullmatch(_HUB_ID, name) is not None
        is_known = bool(store.local_path) or not name or is_remote
        if not is_known and not _exists(_place(context, own, name)):
            folder = _place(context, own, name)
            message = f"The data set is neither the folder {folder} nor a hub id such as lerobot/pusht"
            remedy = "Record it first, correct the name, or add ai.data_store with its local_path"
            yield context.missing("dataset-missing", message, own, remedy=remedy)
    if purpose and store.local_path and not _is_folder(place):
        message = f"There is no data set to {purpose}: looked for the folder {place}"
        fetched = f"Run `joshua dataset download URL {place}` with remote_url as the URL"
        remote = store.storage == pb.STORAGE_CLOUD and purpose != "upload"
        yield context.missing("dataset-missing", message, path, remedy=fetched if remote else "")


def _place(context: Context, path: str, value: str) -> Path:
    """Make a path absolute, relative to the file that contains it."""
    expanded = Path(os.path.expanduser(value))  # noqa: PTH111 - an unknown user stays as written
    if expanded.is_absolute():
        return expanded
    return Path(os.path.normpath(folder_of(context.loaded.positions, path, context.loaded.path) / expanded))
