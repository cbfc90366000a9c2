"""Leaves out findings that only repeat what loading has reported already.

A block that could not be read is not «missing», and a topic is not «unpublished» when the publisher
beside it was lost to a syntax error.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterable
from typing import NamedTuple

from joshua.config.checks.device_table import ACTUATOR_BLOCKS, DEVICE_BLOCKS
from joshua.config.loading import LoadedConfig
from joshua.plan import Diagnostic, Position, Severity

# Findings about something that is absent from a block.
_ABSENT_FIELD = frozenset(
    ("required-missing", "too-few-entries", "block-missing", "link-missing", "controls-missing")
)
# Findings that compare parts of the file, or miss one: they do not hold while a part could not be read.
_ABSENT_PART = frozenset(
    (
        "block-unused",
        "calibration-incomplete",
        "calibration-unknown-node",
        "field-unused",
        "hosts-apart",
        "sensor-unpublished",
        "simulation-missing",
        "tls-missing",
        "tls-unused",
        "topic-unpublished",
        "weights-missing",
    )
)
# Errors of loading that cost the value of one field and nothing around it.
_LOCAL = frozenset(
    (
        "bad-escape",
        "duplicate-field",
        "extension-field",
        "extra-comma",
        "missing-brace",
        "missing-colon",
        "missing-comma",
        "missing-value",
        "number-out-of-range",
        "not-utf8-string",
        "oneof-conflict",
        "set-in-two-files",
        "unclosed-string",
        "unexpected-text",
        "unknown-enum-number",
        "unknown-enum-value",
        "unknown-field",
        "unquoted-string",
        "wrong-type",
    )
)
# Errors whose path is that of a block which was read all the same.
_IN_BLOCK = frozenset(("extension-field", "missing-brace", "unexpected-text"))
# Fields whose loss takes more with it than themselves.
_STRUCTURE = frozenset(
    (
        "action_type",
        "actions",
        "ai",
        "calibration",
        "data_type",
        "include",
        "model_type",
        "models",
        "motor_ids",
        "node",
        "node_name",
        "perception_type",
        "perceptions",
        "publishers",
        "robot",
        "ros_namespace",
        "subscriptions",
        "topic_name",
        "transport",
    )
)
_QOS = frozenset(
    ("qos", "reliability", "durability", "liveliness", "deadline_s", "lease_duration_s", "topic_name")
)
_CHOICES = (*ACTUATOR_BLOCKS, *DEVICE_BLOCKS, "serial", "ble")


class _Damage(NamedTuple):
    """What loading could not read.

    Attributes:
        paths: fields that were reported; everything at or below them is settled.
        blocks: blocks of which some field may be lost; everything: whether any block may be damaged.
        names: of the fields that are lost, and of those that were probably meant.
    """

    paths: frozenset[str]
    blocks: frozenset[str]
    names: frozenset[str]
    everything: bool


def without_cascades(
    findings: Iterable[Diagnostic], loaded: LoadedConfig, absent: frozenset[str] = frozenset()
) -> list[Diagnostic]:
    """Drops the findings that follow from errors of loading.

    Args:
        findings: of the checks; loaded: what was checked.
        absent: further codes that say that a part of the file is absent.
    """
    errors = [item for item in loaded.diagnostics if item.severity is Severity.ERROR]
    if not errors:
        return list(findings)
    damage = _assess(errors, loaded)
    return [item for item in findings if not _follows(item, damage, absent)]


def _follows(item: Diagnostic, damage: _Damage, absent: frozenset[str]) -> bool:
    if any(part in damage.paths for part in _enclosing(item.field_path)):
        return True
    if item.code == "qos-incompatible":
        return damage.everything or bool(damage.names & _QOS)
    if item.code == "field-unused" and item.field_path.rpartition(".")[0] in damage.blocks:
        return True  # the field beside it that gives it its effect may be the one that is lost
    if item.code in _ABSENT_PART | absent:
        return damage.everything or bool(damage.names & _STRUCTURE)
    if item.code in _ABSENT_FIELD:
        # A finding about one absent field has its path, one about several that of their block.
        owner = item.field_path.rpartition(".")[0]
        return damage.everything or bool({item.field_path, owner} & damage.blocks)
    return False


def _assess(errors: list[Diagnostic], loaded: LoadedConfig) -> _Damage:
    paths: set[str] = set()
    blocks: set[str] = set()
    names: set[str] = set()
    everything = any(item.code not in _LOCAL for item in errors)
    places = [] if everything else _places(loaded)
    for item in errors:
        if item.code == "oneof-conflict":
            # Which of the two is meant is open, so neither is held against the type beside it.
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
    return _Damage(frozenset(paths), frozenset(blocks), frozenset(names), everything)


def _places(loaded: LoadedConfig) -> list[tuple[str, int, int, str]]:
    """File, line, column and path of every field that is written, in the order of the files."""
    found = []
    for path in loaded.positions.paths():
        name = loaded.positions.name(path)
        if name is not None:
            found.append((name.file, name.line, name.column, path))
    return sorted(found)


def _blocks_near(place: Position, places: list[tuple[str, int, int, str]]) -> list[str]:
    """The blocks around the field that stands last before a place: one of them holds the place."""
    index = bisect_right(places, (place.file, place.line, place.column, "\uffff")) - 1
    if index < 0 or places[index][0] != place.file:
        return []
    return _enclosing(places[index][3])


def _enclosing(path: str) -> list[str]:
    """A path and those around it: ``a.b[1].c`` to ``a.b[1].c``, ``a.b[1]``, ``a.b``, ``a``."""
    found = []
    while path:
        found.append(path)
        path = path[: path.rfind("[")] if path.endswith("]") else path.rpartition(".")[0]
    return found


def _leaf(path: str) -> str:
    return _without_index(path).rpartition(".")[2]


def _without_index(path: str) -> str:
    return path[: path.rfind("[")] if path.endswith("]") else path
