"""The interface with which a simulator replaces devices."""

from joshua.plugins.emulator import Coupling as Coupling
from joshua.plugins.emulator import PhysicsCamera as PhysicsCamera
from joshua.plugins.emulator import PhysicsLink as PhysicsLink
from joshua.plugins.emulator import RealDevice as RealDevice
from joshua.plugins.emulator import SimAdapterError as SimAdapterError
