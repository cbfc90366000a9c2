"""Motors."""

from pybricks.tools import ticks_ms
from pybricks.wire import ask

SAME_MOMENT_MS = 2


class Motor:
    """A motor with an absolute encoder. Raises OSError where there is none on the port.

    Speed and load are those of the moment at which the angle was read, if that was just now.
    """

    def __init__(self, port):
        self.port = port
        self._state = [0, 0, 0]
        self._at_ms = 0
        ask("motor " + port)

    def angle(self):
        """Angle, degrees, with its turns."""
        self._state = ask("state " + self.port)
        self._at_ms = ticks_ms()
        return self._state[0]

    def speed(self):
        """Speed, degrees a second."""
        return self._now()[1]

    def load(self):
        """Estimated load, mN m."""
        return self._now()[2]

    def hold(self):
        """Stops and stays there, with torque."""
        ask("hold " + self.port)

    def stop(self):
        """Lets go."""
        ask("stop " + self.port)

    def track_target(self, target_angle):
        """Goes to an angle as fast as it can."""
        ask("track " + self.port + " " + str(int(target_angle)))

    def _now(self):
        if ticks_ms() - self._at_ms > SAME_MOMENT_MS:
            self.angle()
        return self._state
