"""Executors: order, bounds, stops, and the plugins behind the options."""

from __future__ import annotations

import argparse
import os
from collections.abc import Iterator

import pytest
from job_functions import Counter, killed, process_of, squared
from joshua_jobs.choice import add_options, check_address, chosen, opened
from joshua_jobs.executor import JobError, Stopped
from joshua_jobs.processes import Processes, in_order


@pytest.mark.parametrize("workers", [1, 2])
def test_results_come_in_order_and_an_exception_is_raised_where_its_item_is(workers: int) -> None:
    found = in_order(squared, [5, 4, 3, 2], workers)
    assert [next(found), next(found)] == [25, 16]
    with pytest.raises(ValueError, match="three"):
        next(found)


def test_processes_do_the_work_and_an_executor_can_be_used_again() -> None:
    with Processes(2) as executor:
        first, second = (set(in_order(process_of, range(4), executor)) for _ in range(2))
    assert os.getpid() not in first | second
    assert len(first | second) <= 2


def test_at_most_two_items_per_worker_are_taken_ahead() -> None:
    taken: list[int] = []

    def items() -> Iterator[int]:
        for number in range(100, 200):
            taken.append(number)
            yield number

    with Processes(2) as executor:
        assert next(executor.in_order(squared, items())) == 10_000
    assert len(taken) == 4


@pytest.mark.parametrize("workers", [1, 2])
def test_work_stops_when_asked(workers: int) -> None:
    with Processes(workers) as executor, pytest.raises(Stopped):
        list(executor.in_order(squared, range(100, 200), lambda: True))


def test_a_process_that_is_killed_names_the_remedy_and_others_can_work_after_it() -> None:
    said = "^one of 2 worker processes was killed, probably for lack of memory: lower --workers$"
    with Processes(2) as executor:
        with pytest.raises(JobError, match=said):
            list(executor.in_order(killed, range(12)))
        assert list(executor.in_order(killed, range(3))) == [0, 1, 2]


def test_a_crew_keeps_its_objects() -> None:
    with Processes(1) as executor:
        crew = executor.crew(Counter, [(1,), (10,)])
        assert crew.each("add", [(2,), (3,)]) == [3, 13]
        assert crew.each("add", [(2,), (crew.share(3),)]) == [5, 16]
        with pytest.raises(Stopped):
            crew.each("add", [(1,), (1,)], lambda: True)


def test_a_missing_executor_is_named() -> None:
    with pytest.raises(JobError) as caught:
        check_address("slurm", "here")
    assert str(caught.value) == (
        "--slurm requires a plugin with the executor slurm, which is not installed. Install it"
    )
    assert caught.value.exit_code == 3


def test_an_option_exists_for_each_executor() -> None:
    parser = argparse.ArgumentParser()
    add_options(parser)
    assert chosen(parser.parse_args([])) is None
    assert chosen(parser.parse_args(["--ray", "127.0.0.1:6379"])) == ("ray", "127.0.0.1:6379")
    with opened(None, 3) as executor:
        assert executor.workers == 3
