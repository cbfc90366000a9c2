"""The values of a message as a user writes them on the command line: YAML, of which JSON is a part."""

from __future__ import annotations

from typing import Any

from joshua.messages import MessageError

# No message of ROS 2 comes near; the YAML parser slows down with every level.
_DEEPEST = 50


def read_values(text: str) -> Any:
    """Parses YAML or JSON text.

    Raises:
        MessageError: the text is neither; line and column stand in the message.
    """
    if _depth(text) > _DEEPEST:
        raise MessageError(f"the values cannot be read: they are nested more than {_DEEPEST} deep")
    from ruamel.yaml import YAML
    from ruamel.yaml.error import YAMLError

    try:
        return YAML(typ="safe", pure=True).load(text)
    except YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        place = f"line {mark.line + 1}, column {mark.column + 1}: " if mark else ""
        problem = getattr(error, "problem", None) or str(error).splitlines()[0]
        raise MessageError(
            f"the values cannot be read: {place}{problem}; write YAML or JSON, such as '{{x: 1.0, y: 2.0}}'"
        ) from error
    except ValueError as error:
        raise MessageError(f"the values cannot be read: {error}") from error


def _depth(text: str) -> int:
    """How deep brackets are nested, those in quotes included."""
    deepest = depth = 0
    for letter in text:
        depth += (letter in "[{") - (letter in "]}")
        deepest = max(deepest, depth)
    return deepest
