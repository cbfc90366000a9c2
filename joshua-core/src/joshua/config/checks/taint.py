"""Suppresses findings of rules whose inputs could not be read ("tainted").

A block that could not be read is not "missing", a topic is not "unpublished" if a syntax error hides its
publisher, and a plugin's settings model need not repeat the finding of a check. The table of codes lists what
each rule reads besides its own field: the ``structure`` of nodes and topics, the ``topics`` of every
publisher, the fields ``beside`` it in the same block, or the ``qos`` of others.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import NamedTuple

from joshua.config.checks.device_table import MEMBERS
from joshua.config.loading import LoadedConfig
from joshua.plan import Diagnostic, Position, Severity
from joshua.schema import config_pb2 as pb
from joshua.textproto.positions import Positions, parent

# Fields that define nodes, topics and blocks, and fields that decide which endpoints connect.
_FIELDS = {
    "structure": "action_type actions ai calibration data_type include model_type models motor_ids node "
    "node_name perception_type perceptions publishers robot ros_namespace subscriptions topic_name transport",
    "qos": "qos reliability durability liveliness deadline_s lease_duration_s topic_name",
}

# Errors of loading that lose the value of one field and nothing around it.
_LOCAL = (
    "bad-escape duplicate-field extension-field extra-comma missing-brace missing-colon missing-comma "
    "missing-value number-out-of-range not-utf8-string oneof-conflict set-in-two-files unclosed-string "
    "unexpected-text unknown-enum-number unknown-enum-value unknown-field unquoted-string wrong-type"
)
# Errors with the path of a block that was read nevertheless.
_IN_BLOCK = frozenset(("extension-field", "missing-brace", "unexpected-text"))
_OWNERS = {"robot.actions": pb.SingleAction, "robot.perceptions": pb.SinglePerception}
_CHOICES = (*(name for blocks in MEMBERS.values() for name in blocks), "serial", "ble")


class Taint(NamedTuple):
    """The unknown parts of a configuration.

    Attributes:
        paths: reported fields. Everything at or below them counts as reported.
        blocks: blocks that may have lost a field; everything: whether any block may be damaged.
        names: of the lost fields, and of those probably meant.
        topics: the topic of some publisher is unknown.
    """

    paths: frozenset[str] = frozenset()
    blocks: frozenset[str] = frozenset()
    names: frozenset[str] = frozenset()
    everything: bool = False
    topics: bool = False

    def silences(self, item: Diagnostic) -> bool:
        """Whether a finding depends on something tainted."""
        if any(part in self.paths for part in _enclosing(item.field_path)):
            return True
        from joshua.config.codes import (
            CODES,
        )  # a file without problems does not need the table

        row = CODES.get(item.code)
        if row is None or not row.reads:
            return False
        reads = row.reads.split()
        if self.everything or ("topics" in reads and self.topics):
            return True
        if any(self.names.intersection(_FIELDS.get(read, "").split()) for read in reads):
            return True
        # A finding about one missing field has its path, one about several has that of their block.
        own = {item.field_path, item.field_path.rpartition(".")[0]}
        return "beside" in reads and bool(own & self.blocks)

    def repeats(self, item: Diagnostic, positions: Positions) -> bool:
        """Whether a broken rule of a settings model repeats an error of a check.

        That is an error at its field or inside it. If the field is not set, it is an error about the
        enclosing block or a field beside it, such as a misspelt name.
        """
        path = item.field_path
        if path in self.paths or path in self.blocks:
            return bool(path)
        block = path
        while block and not positions.is_set(block):
            block = parent(block)
        return block != path and (block in self.paths or block in {parent(known) for known in self.paths})


#: A range in the schema may be wider than the plugin's, so both are shown.
_TOLD_APART = "out-of-range"

#: Missing files, and the field whose files plugins also provide, with the nearest names.
_FILES = frozenset(("input-file-missing", "input-file-is-folder"))
_PACKAGED = "model_path"


def one_of_each(
    known: Sequence[Diagnostic], findings: Sequence[Diagnostic], positions: Positions
) -> list[Diagnostic]:
    """Merge the findings of checking and planning without repetitions.

    A settings block of the wrong device gives one error. For a missing model file, the plugin's message is
    shown with the severity of the check.

    Args:
        known: findings of reading and checking; findings: of planning; positions: of the fields.
    """
    known = _one_for_a_wrong_block(known, positions)
    errors = [item for item in known if item.severity is Severity.ERROR and item.field_path]
    files = {
        item.field_path: item for item in known if item.code in _FILES and _leaf(item.field_path) == _PACKAGED
    }
    broken = frozenset(item.field_path for item in errors if item.code != _TOLD_APART) - files.keys()
    taint = Taint(broken, frozenset(around for path in broken for around in _enclosing(path)[1:]))
    # Settings hold a calibration against the range of the schema again.
    calibrated = {item.field_path for item in errors if item.field_path.startswith("calibration.")}
    told: set[str] = set()
    kept = []
    for item in findings:
        if item.code != "invalid-setting":
            kept.append(item)
        elif item.field_path in calibrated:
            continue
        elif item.field_path in files:
            told.add(item.field_path)
            missing = files[item.field_path]
            kept.append(replace(item, code=missing.code, severity=missing.severity))
        elif not taint.repeats(item, positions):
            kept.append(item)
    return [*(item for item in known if not (item.code in _FILES and item.field_path in told)), *kept]


def _one_for_a_wrong_block(known: Sequence[Diagnostic], positions: Positions) -> Sequence[Diagnostic]:
    """Replace the findings inside a settings block of another device by one error about the block."""
    wrong = {item.field_path: item for item in known if item.code == "block-unfit"}
    unknown: dict[str, list[Diagnostic]] = {}
    for item in known:
        if item.code == "unknown-field":
            unknown.setdefault(parent(item.field_path), []).append(item)
    for path, items in unknown.items():
        owner, name = parent(path), _leaf(path)
        members = MEMBERS.get(_OWNERS.get(_without_index(owner)), {})
        fields = [_leaf(item.field_path) for item in items]
        # The block that has most of these fields is probably meant.
        score = {other: sum(f in block.fields_by_name for f in fields) for other, block in members.items()}
        meant = max(score, key=lambda other: score[other], default="")
        if path in wrong or name not in members or len(fields) < 2 or 2 * score[meant] < len(fields):
            continue
        listed = " and ".join([", ".join(fields[:-1]), fields[-1]])
        wrong[path] = replace(
            items[0],
            code="block-unfit",
            message=f"{name} has no fields {listed}; they belong to {meant}.",
            position=positions.name(path),
            field_path=path,
            found=name,
            allowed=(meant,),
            remedy=f"Write {meant} in its place, or remove these fields.",
        )
    inside = tuple(f"{path}." for path in wrong)
    rest = [item for item in known if item.field_path not in wrong and not item.field_path.startswith(inside)]
    return [*rest, *wrong.values()]


def untainted(findings: Iterable[Diagnostic], loaded: LoadedConfig) -> list[Diagnostic]:
    """Drop the findings of checks that depend on unknown values."""
    errors = [item for item in loaded.diagnostics if item.severity is Severity.ERROR]
    topics = not loaded.graph.all_published
    if not errors and not topics:
        return list(findings)
    taint = _assess(errors, loaded, topics)
    return [item for item in findings if not taint.silences(item)]


def _assess(errors: Sequence[Diagnostic], loaded: LoadedConfig, topics: bool) -> Taint:
    paths: set[str] = set()
    blocks: set[str] = set()
    names: set[str] = set()
    everything = any(item.code not in _LOCAL.split() for item in errors)
    places = [] if everything else _places(loaded)
    for item in errors:
        if item.code == "oneof-conflict":
            # It is unclear which of the two is meant, so neither is compared with the type beside it.
            owner = item.field_path.rpartition(".")[0]
            paths.update(f"{owner}.{name}" for name in _CHOICES)
        if item.code in _IN_BLOCK:
            blocks.add(item.field_path)
        if item.field_path and item.code not in _IN_BLOCK:
            paths.add(item.field_path)
            blocks.add(_without_index(item.field_path).rpartition(".")[0])
            names.update({_leaf(item.field_path), *item.allowed[:1]})
        elif item.position is not None and not everything:
            nearby = _blocks_near(item.position, places)
            blocks.update(nearby or [""])
            names.update(_leaf(path) for path in nearby)
            names.update(item.found.split())
    return Taint(frozenset(paths), frozenset(blocks), frozenset(names), everything, topics)


def _places(loaded: LoadedConfig) -> list[tuple[str, int, int, str]]:
    """File, line, column and path of every field that is set, in the order of the files."""
    found = []
    for path in loaded.positions.paths():
        name = loaded.positions.name(path)
        if name is not None:
            found.append((name.file, name.line, name.column, path))
    return sorted(found)


def _blocks_near(place: Position, places: list[tuple[str, int, int, str]]) -> list[str]:
    """The blocks around the last field before a position, one of which contains it."""
    index = bisect_right(places, (place.file, place.line, place.column, "\uffff")) - 1
    if index < 0 or places[index][0] != place.file:
        return []
    return _enclosing(places[index][3])


def _enclosing(path: str) -> list[str]:
    """A path and its enclosing paths: ``a.b[1].c`` to ``a.b[1].c``, ``a.b[1]``, ``a.b``, ``a``."""
    found = []
    while path:
        found.append(path)
        path = path[: path.rfind("[")] if path.endswith("]") else path.rpartition(".")[0]
    return found


def _leaf(path: str) -> str:
    return _without_index(path).rpartition(".")[2]


def _without_index(path: str) -> str:
    return path[: path.rfind("[")] if path.endswith("]") else path
