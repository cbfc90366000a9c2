"""The line to the emulated hardware: one request, one answer, and the end of the program when it is cut."""

from errno import EIO, ENODEV
from select import POLLIN, poll

_pipes = []
_poll = poll()


def open_pipes(requests, answers):
    """Opens both pipes by their descriptors."""
    _pipes.append(open(requests, "wb", 0))
    _pipes.append(open(answers, "rb", 0))
    _poll.register(_pipes[1], POLLIN)


def ask(text):
    """Sends a request and returns the numbers of the answer. Raises OSError as the hub's devices do."""
    _pipes[0].write(text.encode() + b"\n")
    answer = _pipes[1].readline().decode().split()
    if not answer:
        raise SystemExit  # the emulated hub is gone
    if answer[0] == "nodev":
        raise OSError(ENODEV)
    if answer[0] != "ok":
        raise OSError(EIO)
    return [int(word) for word in answer[1:]]


def look():
    """Ends the program when the emulated hub is gone."""
    if _poll.poll(0):
        raise SystemExit
