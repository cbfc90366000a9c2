"""Length-prefixed frames over a UNIX stream socket, with file descriptors where asked for."""

from __future__ import annotations

import array
import socket
import struct
from collections import deque
from collections.abc import Sequence

HEADER = struct.Struct("!I")

#: Largest payload of one frame; the start frame of a large plan stays far below.
MAX_FRAME_BYTES = 8 * 1024 * 1024

#: Bytes read at once; a bounded share of one turn of the loop.
RECEIVE_BYTES = 65536

#: File descriptors that one call may receive.
MAX_DESCRIPTORS = 16


class FrameError(Exception):
    """The other side sent something that is not a frame of this protocol."""


class EndOfStreamError(Exception):
    """The other side has closed the socket or died."""


class FrameSocket:
    """One end of a UNIX stream socket that carries frames; never blocks.

    Args:
        sock: connected UNIX stream socket; this object owns it from now on.
    """

    def __init__(self, sock: socket.socket) -> None:
        sock.setblocking(False)
        self._socket = sock
        self._outgoing = bytearray()
        self._incoming = bytearray()
        self._descriptors: deque[int] = deque()
        self._closed = False

    def fileno(self) -> int:
        """The descriptor for a selector."""
        return self._socket.fileno()

    @property
    def pending_bytes(self) -> int:
        """Bytes that wait for the other side to read."""
        return len(self._outgoing)

    @property
    def closed(self) -> bool:
        """Whether ``close`` has been called."""
        return self._closed

    def send(self, payload: bytes, descriptors: Sequence[int] = ()) -> bool:
        """Sends one frame, or queues what the socket does not take now.

        Args:
            payload: content of the frame.
            descriptors: file descriptors to pass along; the caller may close its copies afterwards.

        Returns:
            Whether everything has left; otherwise call ``flush`` when the socket becomes writable.

        Raises:
            EndOfStreamError: the other side is gone.
        """
        frame = HEADER.pack(len(payload)) + payload
        if descriptors:
            if self._outgoing:
                raise FrameError("descriptors cannot be queued behind unsent bytes")
            frame = frame[self._send_with(frame, descriptors) :]
        self._outgoing += frame
        return self.flush()

    def flush(self) -> bool:
        """Sends what waits; returns whether nothing waits any more. Raises EndOfStreamError."""
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
        """Reads once and returns the complete frames so far.

        Raises:
            EndOfStreamError: the other side is gone and every complete frame has been returned.
            FrameError: the length prefix is out of range.
        """
        try:
            data, descriptors = self._receive_once()
        except (BlockingIOError, InterruptedError):
            return []
        except OSError as error:
            raise EndOfStreamError(str(error)) from error
        self._descriptors.extend(descriptors)
        if not data:
            raise EndOfStreamError("the other side closed the socket")
        self._incoming += data
        return self._split()

    def take_descriptors(self, count: int) -> list[int]:
        """Hands over the oldest received descriptors; raises FrameError if fewer have arrived."""
        if len(self._descriptors) < count:
            raise FrameError(f"{count} descriptors were announced, {len(self._descriptors)} have arrived")
        return [self._descriptors.popleft() for _ in range(count)]

    def close(self) -> None:
        """Closes the socket; a second call does nothing."""
        self._closed = True
        self._socket.close()

    def _send_with(self, frame: bytes, descriptors: Sequence[int]) -> int:
        rights = array.array("i", descriptors).tobytes()
        try:
            return self._socket.sendmsg([frame], [(socket.SOL_SOCKET, socket.SCM_RIGHTS, rights)])
        except OSError as error:
            raise EndOfStreamError(str(error)) from error

    def _receive_once(self) -> tuple[bytes, list[int]]:
        size = array.array("i").itemsize
        space = socket.CMSG_SPACE(MAX_DESCRIPTORS * size)
        data, ancillary, _flags, _address = self._socket.recvmsg(RECEIVE_BYTES, space)
        received = array.array("i")
        for level, kind, content in ancillary:
            if level == socket.SOL_SOCKET and kind == socket.SCM_RIGHTS:
                received.frombytes(content[: len(content) - len(content) % size])
        return data, received.tolist()

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
