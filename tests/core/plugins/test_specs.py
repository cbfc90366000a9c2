"""What describes a plugin is made by name, and never changed."""

from dataclasses import FrozenInstanceError

import pytest
from joshua.plugins.specs import ActuatorSpec, ModelSpec, PluginSpec


def test_fields_have_their_defaults_and_those_of_the_base() -> None:
    spec = ActuatorSpec(implementation="a:B", safe_stop="a:Stop", native="c:D")
    assert (spec.implementation, spec.safe_stop, spec.native, spec.block) == ("a:B", "a:Stop", "c:D", "")
    assert spec.kind == "actuator"
    assert repr(ModelSpec(implementation="a:B")) == "ModelSpec(implementation='a:B')"


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"implementation": "a:B", "safe_stopp": "x"}, "unexpected keyword argument 'safe_stopp'"),
        ({"implementation": "a:B", "kind": "x"}, "unexpected keyword argument 'kind'"),
        ({"block": "x"}, "missing the keyword argument 'implementation'"),
    ],
)
def test_a_wrong_name_is_refused(values: dict[str, str], message: str) -> None:
    with pytest.raises(TypeError, match=message):
        ActuatorSpec(**values)  # type: ignore[arg-type]


def test_a_spec_does_not_change() -> None:
    spec = PluginSpec(implementation="a:B")
    with pytest.raises(FrozenInstanceError):
        spec.block = "x"  # type: ignore[misc]
