"""Motions of mock and simulated devices."""

from joshua.devices.motion import FileMotion as FileMotion
from joshua.devices.motion import Motion as Motion
from joshua.devices.motion import SineMotion as SineMotion
