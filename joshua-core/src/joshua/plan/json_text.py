"""Reading JSON that somebody else wrote, with a bound on its depth."""

from __future__ import annotations

import json
from typing import Any

from joshua.plan.lfs import is_pointer_text

#: As deep as a configuration may be nested.
MAX_DEPTH = 100


def parse_json(text: str | bytes) -> Any:
    """Parse JSON text.

    ``json.loads`` raises RecursionError for deeply nested text, which is no ValueError, so a reader that
    handles broken files would end with a traceback.

    Args:
        text: as str, or encoded as UTF-8, UTF-16 or UTF-32.

    Raises:
        ValueError: the text is not JSON, is a Git LFS pointer, or is nested more than ``MAX_DEPTH`` levels
            deep.
    """
    try:
        content = json.loads(text)
    except RecursionError as error:
        raise _too_deep() from error
    except ValueError as error:
        if is_pointer_text(text):
            raise ValueError("it is a Git LFS pointer, whose file `git lfs pull` fetches") from error
        raise
    if _may_be_deep(text) and _depth(content) > MAX_DEPTH:
        raise _too_deep()
    return content


def _too_deep() -> ValueError:
    return ValueError(f"it is nested more than {MAX_DEPTH} levels deep")


def _may_be_deep(text: str | bytes) -> bool:
    """Return whether there are more opening brackets than levels allowed, which is quick to tell."""
    if isinstance(text, str):
        return text.count("[") + text.count("{") > MAX_DEPTH
    return text.count(b"[") + text.count(b"{") > MAX_DEPTH


def _depth(content: Any) -> int:
    """Return the number of levels, without recursion."""
    deepest = 0
    waiting = [(content, 1)]
    while waiting:
        value, level = waiting.pop()
        if isinstance(value, dict):
            children = list(value.values())
        elif isinstance(value, list):
            children = value
        else:
            continue
        deepest = max(deepest, level)
        if deepest > MAX_DEPTH:
            break
        waiting += [(child, level + 1) for child in children if isinstance(child, (dict, list))]
    return deepest
