"""Facts of a node: typed, of its own kind, and the same after the way to a child process."""

from __future__ import annotations

from typing import Any

import pytest
from joshua.plan import ActuatorFacts, JointRange, NodeKind, NodeSpec, SafeStop, SensorFacts, ServiceFacts
from pydantic import ValidationError


def spec(kind: NodeKind = NodeKind.ACTUATOR, **fields: Any) -> NodeSpec:
    return NodeSpec(name="arm", kind=kind, behaviour="a:B", implementation="c:D", **fields)


@pytest.mark.parametrize("kind", NodeKind)
def test_each_kind_has_facts_of_its_own(kind: NodeKind) -> None:
    made = spec(kind)
    assert made.facts.kind == kind.value
    assert NodeSpec.model_validate_json(made.model_dump_json()) == made


def test_facts_survive_json_with_their_types() -> None:
    facts = ActuatorFacts(
        joints=(JointRange("pan", -1.0, 1.0),), safe_stop=SafeStop("a:stop", "HOLD", (0.5,), 5.0)
    )
    made = NodeSpec.model_validate_json(spec(facts=facts).model_dump_json())
    assert made.facts_as(ActuatorFacts) == facts


def test_a_fact_that_the_kind_has_not_is_refused() -> None:
    with pytest.raises(ValidationError, match="terminal"):
        spec(facts={"terminal": True})
    with pytest.raises(ValidationError, match="the facts of arm are facts of a sensor"):
        spec(facts=SensorFacts())
    with pytest.raises(TypeError, match="/arm is no node with ServiceFacts"):
        spec().facts_as(ServiceFacts)
