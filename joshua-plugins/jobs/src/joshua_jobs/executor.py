"""What an executor does: functions over items, and objects that live in the workers."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any, TypeVar

from typing_extensions import Self

Item = TypeVar("Item")
Result = TypeVar("Result")


class JobError(Exception):
    """Work cannot be spread; the message says where, why and what to do.

    Attributes:
        exit_code: of a command that ends because of it.
    """

    def __init__(self, message: str, exit_code: int = 1) -> None:
        super().__init__(message, exit_code)
        self.message, self.exit_code = message, exit_code

    def __str__(self) -> str:
        return self.message


class Stopped(Exception):
    """The caller stopped the work."""


def never() -> bool:
    """Return False: nobody stops the work."""
    return False


class Crew(ABC):
    """Objects of one kind, each in a worker of its own."""

    @abstractmethod
    def each(
        self,
        method: str,
        arguments: Sequence[tuple[Any, ...]],
        stopping: Callable[[], bool] = never,
        again: Sequence[tuple[Any, ...]] | None = None,
    ) -> list[Any]:
        """Call a method of every object at once; return the results in the order of the objects.

        An object whose worker is lost is made again, and called again.

        Args:
            arguments: one tuple for each object; stopping: asked while waiting.
            again: what an object is called with after it was made again; None for the same arguments.

        Raises:
            Stopped: ``stopping`` returned True. JobError: no worker is left.
        """

    def share(self, value: Any) -> Any:
        """Return what stands for a value in the arguments of ``each``, so that it is sent once for all."""
        return value

    @abstractmethod
    def close(self) -> None:
        """End the objects. Idempotent."""


class Executor(ABC):
    """Workers that do jobs.

    Attributes:
        lost: how often a job was repeated because its worker was lost.
    """

    lost = 0

    @property
    @abstractmethod
    def workers(self) -> int:
        """Jobs that run at the same time."""

    @abstractmethod
    def in_order(
        self,
        function: Callable[[Item], Result],
        items: Iterable[Item],
        stopping: Callable[[], bool] = never,
    ) -> Iterator[Result]:
        """Apply a function to items in the workers; yield the results in the order of the items.

        At most two items per worker are in progress, which bounds the use of memory.

        Args:
            function: at module level, which another process can import; its exception is raised here.
            stopping: asked while waiting.

        Raises:
            Stopped: ``stopping`` returned True. JobError: no worker is left.
        """

    @abstractmethod
    def crew(self, make: Callable[..., Any], arguments: Sequence[tuple[Any, ...]]) -> Crew:
        """Make one object for each tuple of arguments, each in a worker of its own."""

    @abstractmethod
    def close(self) -> None:
        """Release the workers. Idempotent."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
