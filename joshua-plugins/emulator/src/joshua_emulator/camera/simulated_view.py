"""What a camera of a simulation sees: pictures that the physics draws, asked for one by one.

The other side and its packets are described in ``joshua_mujoco_sim.coupling``; any simulator may speak them.
"""

from __future__ import annotations

import contextlib
import json
import socket
import time
from functools import lru_cache
from pathlib import Path

import numpy as np

from joshua_emulator.camera.jpeg_scan import encode_file

#: How often a simulation that does not answer is looked for.
RETRY_S = 0.1

_PACKET_SIZE = 65_536
_ASK = b"?"


class SimulatedView:
    """Pictures of one camera of a simulation, as JPEG files, fetched without blocking.

    Args:
        path: of the simulation's socket; camera: name of a camera of its model.

    Attributes:
        answered: whether there was a simulation, ever; before that the camera is in the dark.
    """

    def __init__(self, path: Path, camera: str) -> None:
        self._path = path
        self._camera = camera
        self._size = (0, 0)
        self._link: socket.socket | None = None
        self._joined = self._asked = False
        self._data = bytearray()
        self._retry_s = float("-inf")
        self.answered = False

    def descriptors(self) -> tuple[int, ...]:
        """File descriptors to wait on."""
        return () if self._link is None else (self._link.fileno(),)

    def ask(self, width: int, height: int) -> bool:
        """Ask for a picture. Return whether that is on its way from now on.

        It is not while the last one is, and while there is no simulation: that is looked for each time.
        """
        if self._link is not None and self._size != (width, height):
            self.close()
        if self._link is None:
            self._connect(width, height)
        if self._link is None or not self._joined or self._asked:
            return False
        try:
            self._link.send(_ASK)
        except OSError:
            self.close()
            return False
        self._asked = True
        return True

    def receive(self) -> bytes | None:
        """Take what has come. Return a picture once it is whole."""
        if self._link is None:
            return None
        width, height = self._size
        try:
            while packet := self._link.recv(_PACKET_SIZE):
                if not self._joined:
                    self._join(packet)
                    continue
                self._data += packet
                if len(self._data) >= width * height * 3:
                    return self._picture()
        except BlockingIOError:
            return None
        except OSError:
            pass
        self.close()  # the simulation has gone, or refuses
        return None

    def close(self) -> None:
        """End the link. Idempotent."""
        link, self._link = self._link, None
        if link is not None:
            link.close()
        self._joined = self._asked = False
        self._data.clear()

    def _connect(self, width: int, height: int) -> None:
        now_s = time.monotonic()
        if now_s < self._retry_s or not self._path.exists():
            return
        self._retry_s = now_s + RETRY_S
        link = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        hello = {"camera": self._camera, "width": width, "height": height}
        try:
            link.connect(str(self._path))
            link.send(json.dumps(hello).encode())
        except OSError:
            link.close()  # it is about to start or to end
            return
        link.setblocking(False)
        self._link, self._size = link, (width, height)

    def _join(self, packet: bytes) -> None:
        """Take the answer to the introduction; why a camera is refused stands in the simulation's log."""
        with contextlib.suppress(ValueError, TypeError):
            self._joined = "error" not in json.loads(packet)
        self.answered = True

    def _picture(self) -> bytes:
        width, height = self._size
        pixels = np.frombuffer(bytes(self._data), np.uint8).reshape(height, width, 3)
        self._data.clear()
        self._asked = False
        return encode_file(pixels)


@lru_cache(maxsize=4)
def dark_picture(width: int, height: int) -> bytes:
    """What a camera shows before the simulation has drawn anything."""
    return encode_file(np.zeros((height, width, 3), np.uint8))
