"""Files that a run reads: whether they are there, and where they were looked for."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Iterator
from pathlib import Path

from joshua.config.checks.blocks import Block
from joshua.config.checks.context import Context
from joshua.config.loading import LoadedConfig
from joshua.plan import Diagnostic
from joshua.schema import config_pb2 as pb
from joshua.schema import options_pb2 as rules
from joshua.schema import simulation_pb2, transport_pb2
from joshua.textproto.field_facts import FieldFacts

# A hub id is «owner/name»; what starts with a dot, a slash or ~ is always a path.
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


def check_paths(
    loaded: LoadedConfig,
    launch: bool,
    *,
    host: str = "",
    is_packaged: Callable[[str], bool | None] = lambda name: None,
) -> list[Diagnostic]:
    """Looks for every file that the configuration names as input.

    Args:
        loaded: what ``joshua.config.load`` returned.
        launch: whether nodes are going to be started: what is missing is an error then, else a note.
        host: this machine's name in the file; files of other machines' nodes are not looked for.
        is_packaged: tells whether an installed plugin brings a simulation model of this name; None where
            none is installed that could, and then a name that is no file stays a note.
    """
    search = _Search(Context(loaded), launch, host, is_packaged)
    return [*search.blocks(), *search.data_sets()]


class _Search:
    def __init__(
        self, context: Context, launch: bool, host: str, is_packaged: Callable[[str], bool | None]
    ) -> None:
        self._context = context
        self._launch = launch
        self._host = host
        self._is_packaged = is_packaged
        self._owners = {entry.owner_path: entry for entry in context.graph.entries}

    def blocks(self) -> Iterator[Diagnostic]:
        """Looks for the files that fields of any block name."""
        for block in self._context.blocks:
            if not self._counts(block.path):
                continue
            for facts in block.facts:
                if not facts.is_string or facts.repeated:
                    continue
                value = getattr(block.message, facts.name)
                if value and len(value) < 4096 and "\0" not in value:
                    yield from self._field(block, facts, value)

    def data_sets(self) -> Iterator[Diagnostic]:
        """Looks for the data sets that the mode reads."""
        config = self._context.config
        store = config.ai.data_store
        if config.general.mode == pb.MODE_DATA_STORE and store.local_path:
            reads = {pb.DATA_STORE_UPLOAD: "upload", pb.DATA_STORE_REPLAY: "replay"}.get(store.operation)
            if reads:
                yield from self._data_set("ai.data_store.local_path", store.local_path, reads)
        passive = config.simulation.mode == simulation_pb2.PASSIVE
        if config.general.mode == pb.MODE_SIMULATION and passive and store.local_path:
            yield from self._data_set("ai.data_store.local_path", store.local_path, "replay")
        if config.general.mode == pb.MODE_SIMULATION and config.simulation.trajectory_path:
            yield from self._recording("simulation.trajectory_path", config.simulation.trajectory_path)
        if config.general.mode == pb.MODE_SIMULATION and config.simulation.HasField("generate"):
            yield from self._fresh_folder("ai.data_store.local_path", store.local_path)
        if config.general.mode == pb.MODE_TRAINING and config.ai.training.method == pb.METHOD_IMITATION:
            name = config.ai.training.imitation_config.dataset_name
            if store.local_path and name:
                yield from self._data_set("ai.data_store.local_path", store.local_path, "train on")
            elif name and not re.fullmatch(_HUB_ID, name):
                path = "ai.training.imitation_config.dataset_name"
                place = self._resolve(path, name)
                if not _exists(place):
                    yield self._missing(
                        "dataset-missing",
                        f"The data set is neither the folder {place} nor a hub id such as lerobot/pusht",
                        path,
                        name,
                        "Record it first, correct the name, or add ai.data_store with its local_path",
                    )

    def _field(self, block: Block, facts: FieldFacts, value: str) -> Iterator[Diagnostic]:
        path = block.field_path(facts.name)
        if facts.kind == rules.KIND_INPUT_FILE:
            yield from self._input_file(facts, path, value)
        elif facts.kind == rules.KIND_SOURCE:
            if facts.named_by(value)[0] == rules.NAMES_FILE:
                yield from self._need_file(path, value, self._resolve(path, value), "video file")
        elif facts.kind == rules.KIND_MODEL:
            yield from self._model(path, value)
        elif facts.kind == rules.KIND_INTERPRETER:
            yield from self._interpreter(path, value)
        elif facts.kind == rules.KIND_OUTPUT_PATH:
            place = self._resolve(path, value)
            if _is_file(place):
                yield self._missing(
                    "output-path-is-file",
                    f"{value} is a file, and a folder is needed here",
                    path,
                    value,
                    f"Choose another path, or move {place} away",
                )

    def _input_file(self, facts: FieldFacts, path: str, value: str) -> Iterator[Diagnostic]:
        place = self._resolve(path, value)
        label = _LABELS.get(facts.name, facts.name.replace("_", " "))
        if facts.name != "model_path":
            yield from self._need_file(path, value, place, label)
            return
        packaged = self._is_packaged(value)
        if packaged is None and not _exists(place):
            yield self._context.note(
                "input-file-missing",
                f"The {label} is no file (looked for {place}); whether it is one of the packaged models "
                "shows when the simulator's plugin is installed",
                path,
                remedy="Install the plugin, or correct the path",
            )
        elif not packaged:
            extra = ", and no simulator that is installed brings a model of this name"
            yield from self._need_file(path, value, place, label, extra)

    def _need_file(
        self, path: str, value: str, place: Path, label: str, extra: str = ""
    ) -> Iterator[Diagnostic]:
        remedy = "Correct the path or put the file there"
        if label == _LABELS["model_path"]:
            remedy += "; the simulator's plugin brings models such as so_arm100/scene.xml"
        if _is_directory(place):
            message = f"The {label} is a folder, and a file is needed"
            yield self._missing("input-file-is-folder", message, path, value, f"Name a file in {place}")
        elif not _exists(place):
            message = f"The {label} does not exist: looked for {place}{extra}"
            yield self._missing("input-file-missing", message, path, value, remedy)
        elif not os.access(place, os.R_OK):
            yield self._missing(
                "input-file-unreadable",
                f"The {label} may not be read by this user",
                path,
                value,
                f"Change the permissions of {place}",
            )

    def _model(self, path: str, value: str) -> Iterator[Diagnostic]:
        place = self._resolve(path, value)
        if _exists(place):
            return
        if self._is_hub_id(path, value):
            return  # fetched from the hub when the node starts
        yield self._missing(
            "weights-not-found",
            f"The weights do not exist: looked for {place}",
            path,
            value,
            "Correct the path, train the model first, or write a hub id such as lerobot/smolvla_base",
        )

    def _is_hub_id(self, path: str, value: str) -> bool:
        """Tells ``lerobot/smolvla_base`` from ``checkpoints/policy``, which look alike."""
        folder = value.partition("/")[0]
        return (
            re.fullmatch(_HUB_ID, value) is not None
            and not value.endswith(_WEIGHT_SUFFIXES)
            and folder not in _FOLDER_NAMES
            and not _is_directory(self._resolve(path, folder))
        )

    def _interpreter(self, path: str, value: str) -> Iterator[Diagnostic]:
        place = self._resolve(path, value)
        if not (_is_file(place) and os.access(place, os.X_OK)):
            yield self._missing(
                "interpreter-missing",
                f"The Python interpreter of this node does not exist or cannot be run: looked for {place}",
                path,
                value,
                "Create the environment, or correct the path of its bin/python",
            )

    def _data_set(self, path: str, value: str, purpose: str) -> Iterator[Diagnostic]:
        place = self._resolve(path, value)
        if not _is_directory(place):
            yield self._missing(
                "dataset-missing",
                f"There is no data set to {purpose}: looked for the folder {place}",
                path,
                value,
                "Record the data set first, or correct local_path",
            )

    def _recording(self, path: str, value: str) -> Iterator[Diagnostic]:
        place = self._resolve(path, value)
        if not _exists(place):
            yield self._missing(
                "input-file-missing",
                f"The recording does not exist: looked for {place}",
                path,
                value,
                "Correct the path, or put the file or the folder of the data set there",
            )

    def _fresh_folder(self, path: str, value: str) -> Iterator[Diagnostic]:
        place = self._resolve(path, value)
        if value and _is_directory(place) and _ask(lambda: any(place.iterdir())):
            yield self._missing(
                "dataset-exists",
                f"The folder {place} is not empty, and a data set is never overwritten",
                path,
                value,
                "Name another local_path, or move the folder away",
            )

    def _missing(self, code: str, message: str, path: str, value: str, remedy: str) -> Diagnostic:
        make = self._context.error if self._launch else self._context.note
        return make(code, message, path, remedy=remedy)

    def _resolve(self, path: str, value: str) -> Path:
        """Makes a path absolute: relative ones start at the file that names them."""
        expanded = Path(os.path.expanduser(value))  # noqa: PTH111 - an unknown user stays as written
        if expanded.is_absolute():
            return expanded
        position = self._context.loaded.positions.value(path)
        names = list(self._context.loaded.sources)
        file = position.file if position is not None and Path(position.file).is_file() else ""
        base = Path(file or (names[0] if names else ".")).parent
        return Path(os.path.normpath(base.absolute() / expanded))

    def _counts(self, path: str) -> bool:
        """Whether this run reads what a block names: the block has an effect, and its node runs here."""
        config = self._context.config
        if path == "transport.tls" and config.transport.kind == transport_pb2.TRANSPORT_DDS:
            return False
        if path.startswith("ai.training") and config.general.mode != pb.MODE_TRAINING:
            return False
        if path == "simulation" and config.general.mode not in (pb.MODE_SIMULATION, pb.MODE_TRAINING):
            return False  # the simulator's own settings say so, where it runs beside the mode
        entry = self._owners.get(".".join(path.split(".")[:2]))
        return entry is None or not entry.node.host or not self._host or entry.node.host == self._host


def _exists(place: Path) -> bool:
    return _ask(place.exists)


def _is_file(place: Path) -> bool:
    return _ask(place.is_file)


def _is_directory(place: Path) -> bool:
    return _ask(place.is_dir)


def _ask(question: Callable[[], bool]) -> bool:
    """Answers a question about a path; a name that the system refuses (too long) does not exist."""
    try:
        return question()
    except OSError:
        return False
