"""Operations of the control channel common to all emulated devices: log and faults."""

from __future__ import annotations

import itertools
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from typing import Any, ClassVar

from joshua_emulator.control import ControlError
from joshua_emulator.event_log import EventLog
from joshua_emulator.fault_rules import FaultRule, Number, check_fault

Request = dict[str, Any]
Operation = Callable[[Request], "dict[str, Any] | None"]
Action = Callable[[], object]


class DeviceOperations(ABC):
    """Operations by name. ``handle`` is the control channel's handler.

    A derived class adds its own to ``operations``.

    Args:
        log: of the device; rules: what each of its faults takes.
    """

    #: Triggers of every fault, except a time.
    when: ClassVar[Mapping[str, Number]] = {}

    #: Errors whose text is returned unchanged.
    refusals: ClassVar[tuple[type[Exception], ...]] = ()

    def __init__(self, log: EventLog, rules: Mapping[str, FaultRule]) -> None:
        self.log = log
        self._rules = rules
        self.operations: dict[str, Operation] = {}
        self._lasting: dict[str, int] = {}
        self._numbers = itertools.count()

    @abstractmethod
    def at(self, delay_s: float, action: Action) -> None:
        """Call ``action`` after a delay, on the loop of the device."""

    @abstractmethod
    def fault_action(self, kind: str, request: Request) -> Action:
        """Return the action that injects a valid fault. Raises ControlError if it is refused."""

    def handle(self, request: Request) -> dict[str, Any]:
        """Execute one request. Raises ControlError."""
        name = request["op"]
        operation = self.operations.get(name)
        if operation is None:
            raise ControlError(f"unknown operation {name!r}; allowed: {', '.join(self.operations)}")
        try:
            return operation(request) or {}
        except KeyError as error:
            raise ControlError(f"{name}: {error.args[0]!r} is missing or unknown") from error
        except self.refusals as error:
            raise ControlError(f"{name}: {error}") from error
        except OverflowError as error:
            raise ControlError(f"{name}: a number is too large ({error})") from error
        except (AttributeError, TypeError, ValueError) as error:
            raise ControlError(f"{name}: a value is wrong ({error})") from error

    def read_log(self, request: Request) -> dict[str, Any]:
        """Return log entries after ``since``, optionally only of the named ``events``."""
        entries = self.log.since(
            int(request.get("since", 0)), request.get("events", ()), int(request.get("limit", 10_000))
        )
        return {"entries": entries}

    def fault(self, request: Request) -> None:
        """Inject a fault: ``kind``, its ``value`` and settings, ``at_s`` seconds from now on."""
        check_fault(request, self._rules, self.when)
        action = self.fault_action(request["kind"], request)
        delay_s = float(request.get("at_s", 0.0))
        if delay_s > 0:
            self.later(delay_s, action)
        else:
            action()

    def later(self, delay_s: float, action: Action) -> None:
        """Execute an action after a delay; if it is impossible by then, log it as ``refused``."""
        impossible: tuple[type[Exception], ...] = (ControlError, OSError, *self.refusals)

        def carry_out() -> None:
            try:
                action()
            except impossible as error:
                self.log.add("refused", time.monotonic(), reason=str(error))

        self.at(delay_s, carry_out)

    def lasting(self, kind: str, request: Request, begin: Action, end: Action) -> Action:
        """Inject a fault until ``value`` seconds pass or ``end_lasting``; the last one of a kind applies."""
        length_s = float(request.get("value", 0.0))

        def start() -> None:
            begin()
            self._lasting[kind] = mine = next(self._numbers)
            if length_s > 0:
                self.later(length_s, lambda: end() if self._lasting.get(kind) == mine else None)

        return start

    def end_lasting(self) -> None:
        """Cancel the scheduled ends of faults; the caller ends them."""
        self._lasting.clear()
