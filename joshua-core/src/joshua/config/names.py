"""The naming rules of ROS 2 for topics, nodes, namespaces and frames.

Source: the ROS 2 design article "Topic and Service name mapping to DDS" and the validation functions of
``rcl`` and ``rmw`` (``rmw/validate_full_topic_name.h``, ``validate_node_name.h``, ``validate_namespace.h``).
"""

from __future__ import annotations

import re
from typing import NamedTuple

# DDS topic names have up to 255 characters. ROS 2 reserves eight of them for its prefixes.
MAX_TOPIC_LENGTH = 247
MAX_NAMESPACE_LENGTH = 245
MAX_NODE_NAME_LENGTH = 255

_WORD = frozenset("ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789_")
_PATH = _WORD | {"/"}
_NOT_WORD = r"[^A-Za-z0-9_]+"


class NameFault(NamedTuple):
    """A broken naming rule.

    Attributes:
        rule: the rule in one sentence.
        offset, length: the invalid part of the name, in characters.
        suggestion: a similar valid name; "" if there is none.
    """

    rule: str
    offset: int
    length: int
    suggestion: str


def topic_fault(name: str) -> NameFault | None:
    """Find the first rule that a topic name breaks, as written: absolute, relative or private (``~``)."""
    if "~" in name:
        at = name.index("~", 1) if "~" in name[1:] else 0
        if at > 0:
            return _fault(name, "~ may stand only at the start of a topic name", at, 1)
        if name not in ("~", "~/") and not name.startswith("~/"):
            return NameFault("~ must be followed by /", 0, 2, _cleaned("~/" + name[1:]))
    return _path_fault(name, "a topic name", MAX_TOPIC_LENGTH)


def namespace_fault(name: str) -> NameFault | None:
    """Find the first rule that a namespace breaks; "/" is the root."""
    if name == "/":
        return None
    if not name.startswith("/"):
        return NameFault("A namespace must start with /", 0, len(name) or 1, _cleaned("/" + name))
    if "~" in name:
        return _fault(name, "A namespace may not contain ~", name.index("~"), 1)
    return _path_fault(name, "a namespace", MAX_NAMESPACE_LENGTH)


def node_name_fault(name: str) -> NameFault | None:
    """Find the first rule that the base name of a node breaks."""
    if "/" in name:
        suggestion = _cleaned(name.rsplit("/", 1)[1]) or _cleaned(name.replace("/", "_"))
        rule = "A node name may not contain /; the namespace has a field of its own, ros_namespace"
        return NameFault(rule, name.index("/"), 1, suggestion)
    if not _WORD.issuperset(name) and (bad := re.search(_NOT_WORD, name)):
        rule = "A node name may contain only letters A-Z a-z, digits and underscores"
        return _fault(name, rule, bad.start(), len(bad.group()))
    if name[:1].isdigit():
        return _fault(name, "A node name may not start with a digit", 0, 1)
    if len(name) > MAX_NODE_NAME_LENGTH:
        return _fault(name, f"A node name may have at most {MAX_NODE_NAME_LENGTH} characters", 0, len(name))
    return None


def frame_fault(name: str) -> NameFault | None:
    """Find the first rule that a tf2 frame id breaks."""
    suggestion = re.sub(r"\s+", "_", name.lstrip("/"))
    if name.startswith("/"):
        return NameFault("A frame id may not start with / since tf2", 0, 1, suggestion)
    if bad := re.search(r"\s", name):
        return NameFault("A frame id may not contain white space", bad.start(), 1, suggestion)
    return None


def is_hidden(name: str) -> bool:
    """Whether ROS 2 tools hide a topic: one of its parts starts with an underscore."""
    return any(part.startswith("_") for part in name.split("/"))


def has_repeated_underscores(name: str) -> bool:
    """Whether a name has ``__``, which ROS 2 reserves."""
    return "__" in name


def _path_fault(name: str, what: str, longest: int) -> NameFault | None:
    if not name:
        return NameFault(f"{_capital(what)} may not be empty", 0, 1, "")
    body = name[1:] if name.startswith("~") else name
    skipped = len(name) - len(body)
    if not _PATH.issuperset(body) and (bad := re.search(r"[^A-Za-z0-9_/]+", body)):
        rule = f"{_capital(what)} may contain only letters A-Z a-z, digits, underscores and /"
        if bad.group()[0] in "{}":
            rule = f"{_capital(what)} may not contain braces: write the name out"
        return _fault(name, rule, bad.start() + skipped, len(bad.group()))
    if "//" in body:
        return _fault(name, f"{_capital(what)} may not contain //", body.index("//") + skipped, 2)
    if name.endswith("/"):
        return _fault(name, f"{_capital(what)} may not end with /", len(name) - 1, 1)
    starts_with_digit = any(part[:1].isdigit() for part in body.split("/"))
    if starts_with_digit and (bad := re.search(r"(?:^|/)([0-9])", body)):
        rule = f"No part of {what} may start with a digit"
        return _fault(name, rule, bad.start(1) + skipped, 1)
    if len(name) > longest:
        return NameFault(
            f"{_capital(what)} may have at most {longest} characters", longest, len(name) - longest, ""
        )
    return None


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]


def _fault(name: str, rule: str, offset: int, length: int) -> NameFault:
    return NameFault(rule, offset, length, _cleaned(name))


def _cleaned(name: str) -> str:
    """Make a similar valid name; "" if nothing valid is left."""
    prefix = "~/" if name.startswith("~") else "/" if name.startswith("/") else ""
    parts = [re.sub(_NOT_WORD, "_", part).strip("_") for part in name.lstrip("~").split("/")]
    parts = [f"n{part}" if part[0].isdigit() else part for part in parts if part]
    return (prefix + "/".join(parts))[:MAX_TOPIC_LENGTH] if parts else ""
