"""Clauses of a contract: running them and reporting violations."""

from __future__ import annotations

import functools
import json
import traceback
from collections.abc import Callable, Collection
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any


@dataclass(frozen=True)
class Violation:
    """One violated clause: its name, what was observed, why that is wrong, and the likely cause."""

    clause: str
    observed: str
    why: str
    cause: str


class ConformanceError(AssertionError):
    """A device or model violates its contract; ``violations`` lists every clause."""

    def __init__(self, subject: str, violations: list[Violation]) -> None:
        self.subject = subject
        self.violations = tuple(violations)
        lines = [f"{subject} violates {len(violations)} clause{'s' * (len(violations) > 1)} of its contract:"]
        for number, item in enumerate(violations, start=1):
            lines += ["", f"{number}. {item.clause}: {item.observed}"]
            lines += [f"   Why it is wrong: {item.why}", f"   Likely cause: {item.cause}"]
        super().__init__("\n".join(lines))


class ViolationError(Exception):
    """Ends a clause with its violation."""

    def __init__(self, observed: str, why: str, cause: str) -> None:
        super().__init__(observed)
        self.observed, self.why, self.cause = observed, why, cause


def violation(row: str, *values: object) -> ViolationError:
    """Return the violation of a row of ``violations.json``. The values complete its observation."""
    observed, why, cause = _rows()[row]
    return ViolationError(observed.format(*values), why, cause)


def must(row: str, holds: bool, *values: object) -> None:
    """End the clause with a row of ``violations.json`` unless something holds. Raises ViolationError."""
    if not holds:
        raise violation(row, *values)


def must_refuse(row: str, call: Callable[[], object], errors: type[Exception], *values: object) -> None:
    """Require that a call raises an error of a kind, with a message. Raises ViolationError."""
    what, why, cause = _rows()[row]
    refuses(call, errors, what.format(*values), why=why, cause=cause)


def require(holds: bool, observed: str, *, why: str, cause: str) -> None:
    """End the clause unless something holds, for kits with their own texts. Raises ViolationError."""
    if not holds:
        raise ViolationError(observed, why, cause)


def refuses(call: Callable[[], object], errors: type[Exception], what: str, *, why: str, cause: str) -> None:
    """Require that a call raises an error of a kind, with a message. Raises ViolationError."""
    try:
        result = call()
    except errors as error:
        must("message.empty", bool(str(error).strip()), what, type(error).__name__)
    except Exception as error:
        observed = f"{what} raised {type(error).__name__} ({error}) instead of {errors.__name__}"
        raise ViolationError(observed, why, cause) from error
    else:
        raise ViolationError(f"{what} returned {result!r} instead of raising {errors.__name__}", why, cause)


def said(error: BaseException) -> str:
    """Return class and message of an error."""
    return f"{type(error).__name__}: {error}"


@functools.cache
def _rows() -> dict[str, tuple[str, str, str]]:
    """Texts of each violation: what was observed, why it is wrong, and the likely cause."""
    text = Path(__file__).with_name("violations.json").read_text(encoding="utf-8")
    return {row: (observed, why, cause) for row, (observed, why, cause) in json.loads(text).items()}


class Checklist:
    """Runs clauses one by one and collects their violations.

    Args:
        subject: name of the checked object.
        only: names of the clauses to check; empty for all.
    """

    def __init__(self, subject: str, only: Collection[str] = ()) -> None:
        self.subject = subject
        self._only = only
        self._names: list[str] = []
        self.violations: list[Violation] = []

    def run(self, name: str, check: Callable[[], None]) -> bool:
        """Run a clause and return whether it holds. An unexpected exception is a violation."""
        self._names.append(name)
        if self._only and name not in self._only:
            return True
        try:
            check()
        except ViolationError as error:
            self.violations.append(Violation(name, error.observed, error.why, error.cause))
        except Exception as error:  # noqa: BLE001 (any exception of the checked code is a finding)
            place = traceback.extract_tb(error.__traceback__)[-1]
            self.violations.append(
                Violation(
                    name,
                    f"{said(error)} (at {place.filename}:{place.lineno})",
                    "a call failed that the contract allows here",
                    "an error at that place, or a device that is not what the driver expects",
                )
            )
        else:
            return True
        return False

    def run_methods(self, clauses: object, *names: str) -> None:
        """Run the methods of an object that are named like the clauses."""
        for name in names:
            self.run(name, getattr(clauses, name.replace(" ", "_")))

    def finish(self) -> None:
        """Raise ConformanceError if a clause was violated, ValueError if ``only`` names no clause."""
        if self.violations:
            raise ConformanceError(self.subject, self.violations)
        if unknown := sorted(set(self._only) - set(self._names)):
            raise ValueError(f"no clause is named {', '.join(unknown)}; clauses: {', '.join(self._names)}")


def name_of(factory: Callable[[], object], close: Callable[[Any], object]) -> str:
    """Return the name of what a factory makes, for the heading of the report."""
    try:
        made = factory()
    except Exception:  # noqa: BLE001 (the clause about the constructor reports it)
        return getattr(factory, "__name__", repr(factory))
    with suppress(Exception):  # the clause about closing reports it
        close(made)
    return type(made).__name__
