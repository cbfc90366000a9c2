"""Length-prefixed frames over a UNIX stream socket, with optional file descriptors."""

from __future__ import annotations

import socket
import struct
from collections import deque
from collections.abc import Sequence

HEADER = struct.Struct("!I")

#: Largest payload of one frame. The start frame of a large plan is far smaller.
MAX_FRAME_BYTES = 8 * 1024 * 1024

#: Bytes read at once, which bounds one turn of the loop.
RECEIVE_BYTES = 65536

#: File descriptors accepted in one call.
MAX_DESCRIPTORS = 16


class FrameError(Exception):
    """The peer sent something that is not a frame of this protocol."""


class EndOfStreamError(Exception):
    """The peer closed the socket or died."""


class FrameSocket:
    """One end of a UNIX stream socket that carries frames. It never blocks.

    Args:
        sock: connected UNIX stream socket. This object owns it.

    Attributes:
        closed: whether ``close`` was called.
    """

    def __init__(self, sock: socket.socket) -> None:
        sock.setblocking(False)
        self.closed = False
        self._socket = sock
        self._outgoing = bytearray()
        self._incoming = bytearray()
        self._descriptors: deque[int] = deque()

    def fileno(self) -> int:
        """Descriptor for a selector."""
        return self._socket.fileno()

    @property
    def pending_bytes(self) -> int:
        """Bytes not sent yet."""
        return len(self._outgoing)

    def send(self, payload: bytes, descriptors: Sequence[int] = ()) -> bool:
        """Sends one frame and queues what the socket does not take.

        Args:
            payload: content of the frame.
            descriptors: file descriptors to pass on. The caller may close its copies afterwards.

        Returns:
            Whether everything was sent. If not, call ``flush`` when the socket becomes writable.

        Raises:
            EndOfStreamError: the peer is gone.
        """
        frame = HEADER.pack(len(payload)) + payload
        if descriptors:
            if self._outgoing:
                raise FrameError("descriptors cannot be queued behind unsent bytes")
            try:
                frame = frame[socket.send_fds(self._socket, [frame], list(descriptors)) :]
            except OSError as error:
                raise EndOfStreamError(str(error)) from error
        self._outgoing += frame
        return self.flush()

    def flush(self) -> bool:
        """Sends queued bytes and returns whether none are left. Raises EndOfStreamError."""
        while self._outgoing:
            try:
                sent = self._socket.send(self._outgoing)
            except (BlockingIOError, InterruptedError):
                return False
            except OSError as error:
                raise EndOfStreamError(str(error)) from error
            del self._outgoing[:sent]
        return True

    def receive(self) -> list[bytes]:
        """Reads once and returns the complete frames.

        Raises:
            EndOfStreamError: the peer is gone and every complete frame has been returned.
            FrameError: the length prefix is out of range.
        """
        try:
            data, descriptors, _, _ = socket.recv_fds(self._socket, RECEIVE_BYTES, MAX_DESCRIPTORS)
        except (BlockingIOError, InterruptedError):
            return []
        except OSError as error:
            raise EndOfStreamError(str(error)) from error
        self._descriptors.extend(descriptors)
        if not data:
            raise EndOfStreamError("the peer closed the socket")
        self._incoming += data
        return self._split()

    def take_descriptors(self, count: int) -> list[int]:
        """Returns the oldest received descriptors. Raises FrameError if there are fewer."""
        if len(self._descriptors) < count:
            raise FrameError(f"{count} descriptors were announced, {len(self._descriptors)} have arrived")
        return [self._descriptors.popleft() for _ in range(count)]

    def close(self) -> None:
        """Closes the socket. Idempotent."""
        self.closed = True
        self._socket.close()

    def _split(self) -> list[bytes]:
        frames = []
        start = 0
        while len(self._incoming) - start >= HEADER.size:
            (length,) = HEADER.unpack_from(self._incoming, start)
            if length > MAX_FRAME_BYTES:
                raise FrameError(f"a frame of {length} bytes; at most {MAX_FRAME_BYTES} are allowed")
            end = start + HEADER.size + length
            if len(self._incoming) < end:
                break
            frames.append(bytes(self._incoming[start + HEADER.size : end]))
            start = end
        del self._incoming[:start]
        return frames
