"""The writer's thread of a recorder, apart from a run."""

from __future__ import annotations

import queue
from types import SimpleNamespace
from typing import Any

from joshua_dataset.recorder import Recorder
from joshua_dataset.session import Phase


class Context:
    """Counts the thread's signs of life: a thread that does not ask counts as hung after a while."""

    asked = 0

    @property
    def stopping(self) -> bool:
        self.asked += 1
        return True


def test_a_writer_that_always_has_work_shows_signs_of_life() -> None:
    context, work = Context(), queue.Queue[Any]()
    done: list[int] = []
    for number in range(200):
        work.put(lambda number=number: done.append(number))
    parts = SimpleNamespace(
        _context=context, _work=work, _session=SimpleNamespace(phase=Phase.DONE), _writer=None, _busy=(0, 0)
    )
    Recorder._write(parts)  # type: ignore[arg-type]
    assert len(done) == 200
    assert context.asked >= 200
