"""JSON of others is read with a bound on its depth."""

from __future__ import annotations

import json

import pytest
from joshua.plan.json_text import MAX_DEPTH, parse_json


def nested(depth: int, opening: str = "[", closing: str = "]") -> str:
    return opening * depth + closing * depth


@pytest.mark.parametrize("depth", [MAX_DEPTH + 1, 500, 100_000])
def test_text_that_is_nested_too_deep_is_a_value_error(depth: int):
    for text in (nested(depth), nested(depth).encode(), '{"a":' * depth + "0" + "}" * depth):
        with pytest.raises(ValueError, match="nested more than 100 levels deep"):
            parse_json(text)


def test_text_within_the_bound_is_read():
    assert parse_json(nested(MAX_DEPTH)) == json.loads(nested(MAX_DEPTH))
    wide = json.dumps([{"a": [number]} for number in range(1000)])
    assert parse_json(wide) == json.loads(wide)
    assert parse_json(b"\xff\xfe1\x00") == 1


def test_other_faults_are_those_of_json():
    with pytest.raises(json.JSONDecodeError, match="Expecting value"):
        parse_json("")


def test_a_git_lfs_pointer_is_named() -> None:
    pointer = "version https://git-lfs.github.com/spec/v1\noid sha256:0\nsize 9\n"
    for text in (pointer, pointer.encode()):
        with pytest.raises(ValueError, match="it is a Git LFS pointer, whose file `git lfs pull` fetches"):
            parse_json(text)
