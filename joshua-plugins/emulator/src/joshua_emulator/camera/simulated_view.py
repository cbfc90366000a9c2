"""Pictures of a simulation's camera, requested one by one from the physics.

``joshua_mujoco_sim.coupling`` describes the packets; any simulator may implement them.
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

#: Retry period while the simulation does not reply.
RETRY_S = 0.1

_PACKET_SIZE = 65_536
_ASK = b"?"


class SimulatedView:
    """Pictures of one camera of a simulation, as JPEG files, fetched without blocking.

    Args:
        path: of the simulation's socket; camera: name of a camera of its model.

    Attributes:
        answered: whether a simulation has ever replied; until then the picture is dark.
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
        """Request a picture. Return whether the request was sent.

        It is not sent while another one is pending or without a simulation, which is looked for each time.
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
        """Receive data. Return a picture once it is complete."""
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
        """Process the reply to the registration; the simulation's log explains a refusal."""
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
    """Return the picture before the first one of the simulation."""
    return encode_file(np.zeros((height, width, 3), np.uint8))
