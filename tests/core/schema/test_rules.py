"""The rule option of a field, read from its descriptor."""

from __future__ import annotations

from joshua.schema import config_pb2, options_pb2
from joshua.schema.rules import rule


def test_a_rule_is_read_from_the_descriptor() -> None:
    found = rule(config_pb2.Publisher.DESCRIPTOR.fields_by_name["publish_rate_hz"])
    assert found.unit == "Hz"
    assert found.above == 0
    assert found.max == 10000
    assert not found.HasField("min")
    assert found.required
    assert found.kind == options_pb2.KIND_RATE


def test_a_field_without_a_rule_has_an_empty_one() -> None:
    field = config_pb2.Config.DESCRIPTOR.fields_by_name["robot"]
    assert rule(field) == options_pb2.FieldRule()
