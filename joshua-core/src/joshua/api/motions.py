"""Motions of mock and simulated devices."""

from joshua.mock.motion import FileMotion as FileMotion
from joshua.mock.motion import Motion as Motion
from joshua.mock.motion import SineMotion as SineMotion
