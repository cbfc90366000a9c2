"""What an executor does: functions over items, objects that live in workers, workers that are connected."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

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


class Disconnected(Exception):
    """A function that works together with others cannot reach them: a worker is lost."""


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
    ) -> list[Any]:
        """Call a method of every object at once; return the results in the order of the objects.

        An object whose worker is lost is made again, and called again with the same arguments.

        Args:
            arguments: one tuple for each object; stopping: asked while waiting.

        Raises:
            Stopped: ``stopping`` returned True. JobError: no worker is left.
        """

    def share(self, value: Any) -> Any:
        """Return what stands for a value in the arguments of ``each``, so that it is sent once for all."""
        return value

    @abstractmethod
    def close(self) -> None:
        """End the objects. Idempotent."""


class Post(ABC):
    """What a function that works together with others has of its caller."""

    @abstractmethod
    def tell(self, value: Any) -> None:
        """Send a value, which the caller gets after all earlier ones of this worker."""

    @property
    @abstractmethod
    def stopping(self) -> bool:
        """Whether the caller wants the function to return soon."""


@dataclass(frozen=True)
class Joint(Generic[Item]):
    """Work of several workers at once.

    Attributes:
        function: at module level, which another process can import. It raises ``Disconnected`` if others are
            lost; any other exception ends all and is raised where the caller is.
        item: given to the function, with a ``Post``; count: of the workers.
        gpus: whether each has a GPU; None for GPUs if there are enough.
        stopping: asked while waiting; it stops nothing here, but the function knows it by its ``Post``.
    """

    function: Callable[[Item, Post], None]
    item: Item
    count: int
    gpus: bool | None = None
    stopping: Callable[[], bool] = never


class Executor(ABC):
    """Workers that do jobs.

    Attributes:
        lost: how often a worker was lost, and its work repeated.
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
            Stopped: ``stopping`` returned True. JobError: no worker is left, or one was killed.
        """

    @abstractmethod
    def crew(self, make: Callable[..., Any], arguments: Sequence[tuple[Any, ...]]) -> Crew:
        """Make one object for each tuple of arguments, each in a worker of its own."""

    def together(self, work: Joint[Any]) -> Iterator[Any]:
        """Do the work of several connected workers; yield what they tell, None from time to time.

        The workers are connected as a process group of PyTorch, which the variables of ``torchrun`` describe
        (RANK, WORLD_SIZE, MASTER_ADDR ...). If one is lost, all begin again, in other processes: the function
        continues from what it saved.

        Raises:
            JobError: the workers cannot be had or connected, or are lost again and again.
        """
        raise JobError(f"{type(self).__name__} cannot connect its workers with each other")

    @abstractmethod
    def close(self) -> None:
        """Release the workers. Idempotent."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
