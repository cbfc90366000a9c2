"""Verbs: how they are declared, and what is said to a caller who does not fit."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated, Any, Literal

import pytest
from joshua.node.verbs import (
    ALWAYS_OPEN,
    Caller,
    InvalidRequestError,
    Verb,
    VerbDeclarationError,
    allowed,
    verb,
    verbs_of,
)
from pydantic import BaseModel, Field


@dataclass(frozen=True)
class Wave:
    times: Annotated[int, Field(ge=1, le=9, description="how often")] = 1
    side: Literal["left", "right"] = "left"
    angles_rad: dict[str, float] = field(default_factory=dict)


class Waved(BaseModel):
    done: int
    seconds: float


class Arm:
    @property
    def broken(self) -> str:
        raise AssertionError("listing the verbs must not touch the device")

    @verb(moves=True)
    def wave(self, wave: Wave) -> Waved:
        """Waves.

        More than the first line is not shown.
        """
        return Waved(done=wave.times, seconds=0.5)

    @verb(moves=False, runs="beside", name="say")
    def greet(self) -> str:
        """Says hello."""
        return "hello"

    @verb(moves=False)
    def rest(self) -> None:
        """Does nothing."""

    @verb(moves=False)
    def lie(self) -> Waved:
        return "no such thing"  # type: ignore[return-value]


class CalmArm(Arm):
    def greet(self) -> str:
        return "hush"


class Helper:
    @verb(moves=True)
    def say(self) -> str:
        return "the second of a name does not count"

    @verb(moves=False)
    def help(self) -> str:
        return "helps"


def the(name: str, *providers: object) -> Verb:
    return verbs_of(providers or (Arm(),))[name]


def test_the_verbs_of_a_behaviour_and_its_driver_are_found_by_name() -> None:
    verbs = verbs_of((CalmArm(), Helper()))
    assert list(verbs) == ["help", "lie", "rest", "say", "wave"]
    assert (verbs["wave"].moves, verbs["wave"].runs, verbs["wave"].summary) == (True, "loop", "Waves.")
    assert (verbs["say"].moves, verbs["say"].runs) == (False, "beside")
    assert verbs["say"].bind({})() == {"text": "hush"}


def test_a_reply_is_data() -> None:
    assert the("wave").bind({"times": "3"})() == {"done": 3, "seconds": 0.5}
    assert the("rest").bind({})() == {}
    with pytest.raises(TypeError, match=r"the verb lie returned 'no such thing', but declares .*Waved"):
        the("lie").bind({})()


def test_a_verb_describes_itself() -> None:
    info = the("wave").info()
    assert info.request["properties"]["times"] == {
        "default": 1,
        "description": "how often",
        "maximum": 9,
        "minimum": 1,
        "title": "Times",
        "type": "integer",
    }
    assert info.reply["required"] == ["done", "seconds"]
    assert (the("say").info().request, the("say").info().reply) == ({}, {})


@pytest.mark.parametrize(
    ("payload", "text"),
    [
        ({"times": 0}, "wave: times: Input should be greater than or equal to 1"),
        ({"times": "x"}, "wave: times: Input should be a valid integer"),
        ({"tims": 1}, "wave: tims: no such field; did you mean times? (times, side, angles_rad)"),
        ({"angles_rad": {"a": float("nan")}}, "wave: angles_rad: a number is not finite"),
        ({"angles_rad": {"a": float("inf")}}, "wave: angles_rad: a number is not finite"),
        ({"angles_rad": {"a": "inf"}}, "wave: angles_rad: a number is not finite"),
        ({"angles_rad": {"a": "far"}}, "wave: angles_rad.a: Input should be a valid number"),
        ({"side": "up", "times": 10}, "side: Input should be 'left' or 'right'"),
    ],
)
def test_every_field_that_does_not_fit_is_named(payload: dict[str, Any], text: str) -> None:
    with pytest.raises(InvalidRequestError) as caught:
        the("wave").bind(payload)
    assert text in str(caught.value)


def test_all_problems_are_said_at_once() -> None:
    with pytest.raises(
        InvalidRequestError, match=r"y: no such field .*; x: no such field .*; times: .*; side: "
    ):
        the("wave").bind({"y": 1, "x": 2, "times": 0, "side": "up"})
    with pytest.raises(InvalidRequestError, match=r"say: loud: no such field \(it takes none\)"):
        the("say").bind({"loud": True})


def test_what_moves_is_open_to_the_local_user_only_and_a_stop_to_everybody() -> None:
    stranger = Caller("network", "somebody")
    assert allowed(the("wave"), Caller()) == ""
    assert allowed(the("say"), stranger) == ""
    assert allowed(the("wave"), stranger).startswith(
        "wave enables torque or moves a joint: only the user who runs"
    )
    for name in ALWAYS_OPEN:
        assert allowed(Verb(name, "", None, None, True, "loop", print), stranger) == ""


class Two:
    @verb(moves=False)
    def both(self, one: Wave, two: Wave) -> None: ...


class Untyped:
    @verb(moves=False)
    def vague(self, what) -> None: ...


class Silent:
    @verb(moves=False)
    def quiet(self): ...


class Plain:
    @verb(moves=False)
    def count(self, number: int) -> None: ...


class Number:
    @verb(moves=False)
    def number(self) -> int:
        return 1


@pytest.mark.parametrize(
    ("provider", "text"),
    [
        (Two(), "Two.both: a verb takes one request at most"),
        (Untyped(), "Untyped.vague: a verb takes one request at most"),
        (Silent(), "Silent.quiet: a verb takes one request at most; annotate it and the return"),
        (Plain(), "Plain.count: its request must be a dataclass or a pydantic model"),
        (Number(), "Number.number: it must return a dataclass, a pydantic model, str or None"),
    ],
)
def test_a_declaration_that_cannot_be_served_is_named(provider: object, text: str) -> None:
    with pytest.raises(VerbDeclarationError) as caught:
        verbs_of((provider,))
    assert text in str(caught.value)
