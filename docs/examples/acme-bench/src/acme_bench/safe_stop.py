"""The safe stop of the clamp. The guardian runs it in a process of its own: import nothing heavy here."""

import time
from dataclasses import dataclass

from joshua.api import DeviceError, SafeStopRequest, SafeStopResult, TorqueState
from joshua_serial.port import SerialPort
from joshua_serial.usb_ports import Endpoint

from acme_bench.link import ask, goal


@dataclass(frozen=True)
class ClampStop(SafeStopRequest):
    """How the clamp is reached; the fields go through JSON."""

    path: str = ""
    serial_number: str = ""
    baudrate: int = 115_200

    def run(self) -> SafeStopResult:
        """Open the port that the dead driver held, act, and report what the clamp confirms."""
        port = SerialPort(Endpoint(self.path, self.serial_number), self.baudrate)
        end_s = time.monotonic() + self.timeout_s
        while True:
            try:
                port.open()
                return SafeStopResult({"clamp": self._act(port)}, self.action)
            except DeviceError as error:
                if time.monotonic() > end_s:
                    return SafeStopResult({"clamp": "not verified"}, self.action, str(error))
            finally:
                port.close()
            time.sleep(0.01)  # the system is still closing the driver's handles, or a byte was lost

    def read_torque(self) -> dict[str, bool]:
        """Tell ``joshua status`` whether the clamp keeps its torque after a run. Raises DeviceError."""
        port = SerialPort(Endpoint(self.path, self.serial_number), self.baudrate)
        port.open()
        try:
            return {"clamp": ask(port, "S").torque}
        finally:
            port.close()

    def _act(self, port: SerialPort) -> TorqueState:
        state = ask(port, "S")
        if self.action == "HOLD":
            if not state.torque:
                return "was off"
            ask(port, goal(state.position_rad))
            return "held" if ask(port, "S").torque else "not verified"
        ask(port, "T0")  # also for PARK_THEN_RELEASE: the clamp has no pose to park in
        return "not verified" if ask(port, "S").torque else "released"
