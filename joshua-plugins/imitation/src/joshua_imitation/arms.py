"""Several arms as one: a policy of LeRobot has one state and one action."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from joshua.features import ACTION, STATE, own_names


def joined_features(described: Mapping[str, Any]) -> tuple[dict[str, Any], dict[str, list[str]]]:
    """Join the states and the actions of several arms, as ``info.json`` describes them.

    Joints get the part of their arm's name that differs from the others': ``left_shoulder_pan.pos``, the
    names of LeRobot and of models that drive several arms.

    Returns:
        The features, and the parts of each joined one; no parts where nothing is to be joined.
    """
    arms = [key.removeprefix(f"{ACTION}.") for key in described if key.startswith(f"{ACTION}.")]
    parts = {key: [f"{key}.{arm}" for arm in arms] for key in (STATE, ACTION)}
    if ACTION in described or STATE in described or len(arms) < 2:
        return dict(described), {}
    if not all(_is_arm(described.get(part)) for keys in parts.values() for part in keys):
        return dict(described), {}
    if len({str(described[part].get("unit", "")) for keys in parts.values() for part in keys}) > 1:
        return dict(described), {}
    gone = {part for keys in parts.values() for part in keys}
    found = {key: values for key, values in described.items() if key not in gone}
    for key, keys in parts.items():
        names = [list(described[part]["names"]) for part in keys]
        if len({name for own in names for name in own}) < sum(map(len, names)):
            own_parts = zip(own_names(arms), names, strict=True)
            names = [[f"{arm}_{name}" for name in own] for arm, own in own_parts]
        all_names = [name for own in names for name in own]
        found[key] = {**described[keys[0]], "shape": [len(all_names)], "names": all_names}
    return found, parts


def _is_arm(values: Any) -> bool:
    """Whether a feature is a vector of named joints."""
    names = values.get("names") if isinstance(values, Mapping) else None
    return isinstance(names, (list, tuple)) and list(values.get("shape", ())) == [len(names)]
