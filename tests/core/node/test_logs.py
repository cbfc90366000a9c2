"""Log records on their way to the supervisor."""

from __future__ import annotations

import logging
import threading

import pytest
from joshua.ipc.line_budget import LINES_PER_S, LineBudget
from joshua.node.logs import MAX_TEXT, NodeLogHandler, node_logger


@pytest.fixture
def logs():
    sent = []
    handler = NodeLogHandler(sent.append, "/first")
    loggers = []

    def logger(name):
        made = node_logger(name, logging.DEBUG)
        made.propagate = False
        made.handlers[:] = [handler]
        loggers.append(made)
        return made

    yield sent, handler, logger
    for made in loggers:
        made.handlers.clear()
        made.filters.clear()
        made.propagate = True


def test_a_record_carries_node_level_text_and_place(logs):
    sent, _, logger = logs
    logger("/left/arm").warning("motor %d is at %.1f °C", 3, 61.25)

    (log,) = sent
    assert (log.node, log.level, log.text) == ("/left/arm", logging.WARNING, "motor 3 is at 61.2 °C")
    assert log.file == __file__
    assert log.line > 0


def test_records_of_libraries_belong_to_the_node_of_their_thread(logs):
    sent, handler, _ = logs
    library = logging.getLogger("some.library")
    library.handlers[:] = [handler]
    library.propagate = False

    def work():
        handler.adopt_thread("/second")
        library.error("from the thread")

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    library.error("from elsewhere")
    library.handlers.clear()
    library.propagate = True
    assert [(log.node, log.text) for log in sent] == [
        ("/second", "from the thread"),
        ("/first", "from elsewhere"),
    ]


def test_an_exception_is_shown_with_its_place(logs):
    sent, _, logger = logs
    try:
        raise KeyError("x")
    except KeyError:
        logger("/a").exception("lost")
    assert sent[0].text.startswith("lost\nTraceback")
    assert "KeyError: 'x'" in sent[0].text


def test_a_record_that_cannot_be_formatted_or_is_huge_fails_nobody(logs):
    sent, _, logger = logs

    class Bad:
        def __str__(self):
            raise RuntimeError("no text")

        __repr__ = __str__

    log = logger("/a")
    log.info("%d", "x")
    log.info("y" * 100_000)
    assert "cannot be formatted" in sent[0].text
    assert len(sent[1].text) < MAX_TEXT + 100


def test_a_flood_is_cut_and_counted_at_the_end(logs, monkeypatch):
    sent, handler, logger = logs
    monkeypatch.setattr("joshua.node.logs.LineBudget", lambda: LineBudget(clock=lambda: 100.0))
    log = logger("/a")
    for index in range(LINES_PER_S * 3):
        log.info("line %d", index)
    handler.settle("/a", ended=True)

    assert len(sent) == LINES_PER_S + 1
    assert sent[-1].text.endswith(f"log lines dropped: more than {LINES_PER_S} in a second")
    dropped = sum(int(item.text.split()[0]) for item in sent if "dropped" in item.text)
    shown = sum(item.text.startswith("line ") for item in sent)
    assert dropped + shown == LINES_PER_S * 3


def test_an_observer_that_fails_is_cut_off_with_a_warning(logs):
    sent, handler, logger = logs

    def fail(_log):
        raise RuntimeError("no transport")

    handler.observe("/a", fail)
    log = logger("/a")
    log.info("one")
    log.info("two")
    assert [item.text for item in sent] == [
        "one",
        "log records are not published any more: no transport",
        "two",
    ]
