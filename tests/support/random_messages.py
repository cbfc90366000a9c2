"""Random values for every field of a message type."""

from __future__ import annotations

import random
import string
from typing import Any

import numpy as np
from joshua.messages.fields import PLACEHOLDER, fields


def random_value(base: str, rng: random.Random) -> Any:
    if base == "string":
        return "".join(rng.choices(string.ascii_letters + "äπ🤖 ", k=rng.randrange(9)))
    if base == "bool":
        return rng.random() < 0.5
    if base.startswith("float"):
        return float(np.dtype(base).type(rng.uniform(-1e3, 1e3)))
    limits = np.iinfo({"byte": "uint8", "char": "uint8"}.get(base, base))
    return rng.randint(limits.min, limits.max)


def random_fields(type_name: str, rng: random.Random) -> dict[str, Any]:
    values = {}
    for field in fields(type_name):
        if field.wire_name == PLACEHOLDER:
            continue
        count = {"one": 1, "array": field.length, "sequence": rng.randrange(4)}[field.shape]
        items = [
            random_fields(field.base, rng) if field.is_message else random_value(field.base, rng)
            for _ in range(count)
        ]
        values[field.wire_name] = items[0] if field.shape == "one" else items
    return values


def plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {name: plain(item) for name, item in value.items()}
    if isinstance(value, np.ndarray):
        return value.tolist()
    return [plain(item) for item in value] if isinstance(value, list) else value
