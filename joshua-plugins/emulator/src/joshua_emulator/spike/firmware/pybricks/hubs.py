"""The hub itself."""

from pybricks.wire import ask


class Battery:
    """The battery of the hub."""

    def voltage(self):
        """Voltage, mV."""
        return ask("battery")[0]

    def current(self):
        """Current, mA."""
        return ask("battery")[1]


class ThisHub:
    """The hub that runs the program."""

    def __init__(self):
        self.battery = Battery()
