"""The page as a front end: it passes boards to the server and requests from it."""

from __future__ import annotations

import queue
import time
from collections.abc import Sequence

from joshua_calibration.front_end import Board, FrontEnd, Request
from joshua_calibration.page.server import PageServer

LAST_WORD_S = 0.3  # time for pages to fetch the last board


class PageFrontEnd(FrontEnd):
    """Shows the board in browsers of this machine."""

    def __init__(self) -> None:
        self._asked: queue.SimpleQueue[Request] = queue.SimpleQueue()
        self._server = PageServer(self._asked.put)
        self._closed = False

    @property
    def address(self) -> str:
        """Address that a browser opens."""
        return self._server.address

    def opening_address(self) -> str:
        """Return a one-time address of the page, for the command line of a browser."""
        return self._server.opening_address()

    @property
    def can_ask(self) -> bool:
        """A browser can be opened at any time."""
        return not self._closed

    def show(self, board: Board) -> None:
        """Send the board to every open page."""
        self._server.channel.put(board)

    def say(self, text: str) -> None:
        """Do nothing: the page shows all messages on its board."""

    def requests(self) -> Sequence[Request]:
        """Return the requests from buttons and keys."""
        found = []
        while not self._asked.empty():
            found.append(self._asked.get())
        return found

    def close(self) -> None:
        """Give pages time to fetch the last board, then stop the server."""
        if not self._closed:
            self._closed = True
            self._server.channel.close()
            time.sleep(LAST_WORD_S)
            self._server.close()
