"""The page as a front end: boards go to the server, requests come from it."""

from __future__ import annotations

import queue
import time
from collections.abc import Sequence

from joshua_calibration.front_end import Board, FrontEnd, Request
from joshua_calibration.page.server import PageServer

LAST_WORD_S = 0.3  # how long pages may take to fetch the last board


class PageFrontEnd(FrontEnd):
    """Shows the board in browsers of this machine."""

    def __init__(self) -> None:
        self._asked: queue.SimpleQueue[Request] = queue.SimpleQueue()
        self._server = PageServer(self._asked.put)
        self._closed = False

    @property
    def address(self) -> str:
        """What a browser opens."""
        return self._server.address

    def opening_address(self) -> str:
        """An address that leads to the page once, for the command line of a browser."""
        return self._server.opening_address()

    @property
    def can_ask(self) -> bool:
        """A browser can be opened at any time."""
        return not self._closed

    def show(self, board: Board) -> None:
        """Send the board to every page that is open."""
        self._server.channel.put(board)

    def say(self, text: str) -> None:
        """The page shows all that is said on its board."""

    def requests(self) -> Sequence[Request]:
        """Buttons and keys that were pressed."""
        found = []
        while not self._asked.empty():
            found.append(self._asked.get())
        return found

    def close(self) -> None:
        """Let pages have the last board, then stop the server."""
        if not self._closed:
            self._closed = True
            self._server.channel.close()
            time.sleep(LAST_WORD_S)
            self._server.close()
