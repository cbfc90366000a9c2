"""Stop requests by scanner model."""

from __future__ import annotations

from joshua_lidar.requests import SET_PWM, SET_RPM, STOP, YDLIDAR_STOP, request

MOTOR_PWM = 660  # of 1023, the usual speed
MOTOR_RPM = 600

_STILL = (0).to_bytes(2, "little")

#: Requests in order. A scanner without requests cannot be stopped.
STOP_BYTES: dict[str, tuple[bytes, ...]] = {
    "rplidar_a1": (request(STOP), request(SET_PWM, _STILL)),
    "rplidar_c1": (request(STOP), request(SET_RPM, _STILL)),
    "lds01": (b"e",),
    "ydlidar_x4": (request(YDLIDAR_STOP),),
    "ydlidar_x2": (),
    "ld06": (),
    "ld19": (),
}

#: State of DTR for motor off, if the adapter uses it as a switch.
STILL_DTR = {"rplidar_a1": True, "ydlidar_x2": False, "ydlidar_x4": False}
