"""Any device on a port."""

from pybricks.wire import ask


class PUPDevice:
    """A device on a port. Raises OSError where there is none."""

    def __init__(self, port):
        self.port = port
        ask("device " + port)

    def info(self):
        """The kind of the device."""
        return {"id": ask("device " + self.port)[0]}
