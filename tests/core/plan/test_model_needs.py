from __future__ import annotations

import dataclasses
from typing import Any

import pytest
from joshua.plan import Compute, Execution
from joshua.plugins.block_values import default_values
from joshua.schema import config_pb2 as pb


@pytest.mark.parametrize(
    ("values", "block"), [(Execution(), pb.ModelExecution), (Compute(), pb.ModelCompute)]
)
def test_the_defaults_are_those_of_the_schema(values: Any, block: Any):
    assert dataclasses.asdict(values) == default_values(block.DESCRIPTOR)
