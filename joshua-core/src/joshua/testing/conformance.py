"""What the conformance kit finds: clauses that a device or a model violates, and how it says so."""

from __future__ import annotations

from collections.abc import Callable, Collection
from contextlib import suppress
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Violation:
    """One violated clause.

    Attributes:
        clause: its name, such as ``limits``.
        observed: what was seen.
        why: why that is wrong.
        cause: what it most likely comes from.
    """

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
            lines += [
                "",
                f"{number}. {item.clause}: {item.observed}",
                f"   Why it is wrong: {item.why}",
                f"   Likely cause: {item.cause}",
            ]
        super().__init__("\n".join(lines))


class ViolationError(Exception):
    """Ends a clause with its violation."""

    def __init__(self, observed: str, why: str, cause: str) -> None:
        super().__init__(observed)
        self.observed, self.why, self.cause = observed, why, cause


def require(holds: bool, observed: str, *, why: str, cause: str) -> None:
    """Ends the clause unless something holds. Raises ViolationError."""
    if not holds:
        raise ViolationError(observed, why, cause)


def refuses(call: Callable[[], object], errors: type[Exception], what: str, *, why: str, cause: str) -> None:
    """Requires that a call raises an error of a kind, with a message. Raises ViolationError."""
    wanted = errors.__name__
    try:
        result = call()
    except errors as error:
        require(
            bool(str(error).strip()),
            f"{what} raised {type(error).__name__} without a message",
            why="the user sees the message and nothing else",
            cause="the error is raised without a text that names the device and the remedy",
        )
    except Exception as error:
        raise ViolationError(
            f"{what} raised {type(error).__name__} ({error}) in place of {wanted}", why, cause
        ) from error
    else:
        raise ViolationError(f"{what} returned {result!r} in place of raising {wanted}", why, cause)


class Checklist:
    """Runs clauses one by one and collects their violations.

    Args:
        subject: name of what is checked.
        only: names of the clauses to check; empty for all.
    """

    def __init__(self, subject: str, only: Collection[str] = ()) -> None:
        self.subject = subject
        self._only = only
        self.violations: list[Violation] = []

    def run(self, clause: str, check: Callable[[], None]) -> bool:
        """Runs a clause; returns whether it holds. An exception that it does not expect is a violation."""
        if self._only and clause not in self._only:
            return True
        try:
            check()
        except ViolationError as error:
            self.violations.append(Violation(clause, error.observed, error.why, error.cause))
            return False
        except Exception as error:  # noqa: BLE001 (whatever the checked code raises is a finding)
            self.violations.append(
                Violation(
                    clause,
                    f"{type(error).__name__}: {error} (at {_place(error)})",
                    "a call that the contract allows here failed",
                    "a fault at the place that is named, or a device that is not as the driver expects",
                )
            )
            return False
        return True

    def finish(self) -> None:
        """Raises ConformanceError if a clause was violated."""
        if self.violations:
            raise ConformanceError(self.subject, self.violations)


def name_of(factory: Callable[[], object], close: Callable[[Any], object]) -> str:
    """Name of what a factory makes, for the heading of the findings."""
    try:
        made = factory()
    except Exception:  # noqa: BLE001 (the clause about the constructor reports it)
        return getattr(factory, "__name__", repr(factory))
    with suppress(Exception):  # the clause about closing reports it
        close(made)
    return type(made).__name__


def _place(error: BaseException) -> str:
    trace = error.__traceback__
    while trace is not None and trace.tb_next is not None:
        trace = trace.tb_next
    if trace is None:
        return "unknown place"
    return f"{trace.tb_frame.f_code.co_filename}:{trace.tb_lineno}"
