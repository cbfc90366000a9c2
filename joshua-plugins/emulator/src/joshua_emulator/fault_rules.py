"""Values and settings that each fault of an emulated device accepts."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from joshua_emulator.control import ControlError

_LONGEST_S = 86_400.0


@dataclass(frozen=True)
class Number:
    """A number from ``low`` to ``high``.

    Attributes:
        allowed: the range in words; whole: no fractions; above: ``low`` itself is not allowed.
    """

    allowed: str
    low: float
    high: float
    whole: bool = False
    above: bool = False

    def fits(self, value: Any) -> bool:
        """Whether a value is one of these; not a number is none."""
        if isinstance(value, bool) or not isinstance(value, int if self.whole else (int, float)):
            return False
        return self.low < value <= self.high if self.above else self.low <= value <= self.high


@dataclass(frozen=True)
class Text:
    """A text that matches a regular expression; ``allowed`` describes it."""

    allowed: str
    form: str

    def fits(self, value: Any) -> bool:
        """Whether a value is one of these."""
        return isinstance(value, str) and re.fullmatch(self.form, value) is not None


@dataclass(frozen=True)
class FaultRule:
    """Value and settings of one fault.

    Attributes:
        value: after the equals sign; None if the fault takes none.
        optional: the value may be left out.
        settings: further settings by name, except ``at_s``.
        unfit: why this device does not support the fault; "" if it does.
    """

    value: Number | Text | None = None
    optional: bool = False
    settings: Mapping[str, Number | Text] = field(default_factory=dict)
    unfit: str = ""


SECONDS = Number("seconds above 0, at most 86400", 0.0, _LONGEST_S, above=True)
PROBABILITY = FaultRule(Number("a probability from 0 to 1", 0.0, 1.0))
PLAIN = FaultRule()
LASTS = FaultRule(SECONDS, optional=True)
RETURNS = FaultRule(settings={"replug_after_s": SECONDS})
LINE_SPEED = FaultRule(Number("a line speed of 300 to 4000000 bit/s", 300, 4_000_000, whole=True))

_START = Number("seconds from 0 to 86400", 0.0, _LONGEST_S)
_ENVELOPE = ("op", "kind", "value")


def check_fault(
    request: Mapping[str, Any],
    rules: Mapping[str, FaultRule],
    when: Mapping[str, Number] | None = None,
) -> None:
    """Check a fault request against the rules of a device.

    Args:
        rules: by kind of fault; when: triggers of every fault, except ``at_s``.

    Raises:
        ControlError: the fault does not exist or does not fit. The message says what is allowed.
    """
    kind = request["kind"]
    if kind not in rules:
        raise ControlError(f"unknown fault {kind!r}; allowed: {', '.join(rules)}")
    rule = rules[kind]
    if rule.unfit:
        fit = ", ".join(name for name, other in rules.items() if not other.unfit)
        raise ControlError(f"{kind}: {rule.unfit}; allowed here: {fit}")
    _check_value(kind, rule, request)
    settings = {"at_s": _START, **(when or {}), **rule.settings}
    for name in request:
        if name not in _ENVELOPE:
            _check_setting(kind, name, request[name], settings)


def _check_value(kind: str, rule: FaultRule, request: Mapping[str, Any]) -> None:
    if "value" not in request:
        if rule.value is not None and not rule.optional:
            raise ControlError(f"{kind} needs a value, as in {kind}=…: {rule.value.allowed}")
    elif rule.value is None:
        value = request["value"]
        when = f"{value:g}" if _START.fits(value) else "5"
        raise ControlError(
            f"{kind} takes no value, found {value!r}; to make it happen {when} s after the start, write "
            f"{kind},at_s={when}"
        )
    elif not rule.value.fits(request["value"]):
        raise ControlError(f"{kind} is {request['value']!r}; allowed: {rule.value.allowed}")


def _check_setting(kind: str, name: str, value: Any, settings: Mapping[str, Number | Text]) -> None:
    if name not in settings:
        from joshua.tools import nearest_first

        allowed = ", ".join(nearest_first(name, settings))
        raise ControlError(f"{kind} has no setting {name!r}; allowed: {allowed}")
    if not settings[name].fits(value):
        raise ControlError(f"{kind}: {name} is {value!r}; allowed: {settings[name].allowed}")
