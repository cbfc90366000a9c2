"""The interface of a device emulator."""

from joshua.plugins.emulator import Coupling as Coupling
from joshua.plugins.emulator import DeviceEmulator as DeviceEmulator
from joshua.plugins.emulator import EmulatedDevice as EmulatedDevice
from joshua.plugins.emulator import EmulationError as EmulationError
from joshua.plugins.emulator import FaultRefusedError as FaultRefusedError
from joshua.plugins.emulator import PhysicsCamera as PhysicsCamera
from joshua.plugins.emulator import PhysicsLink as PhysicsLink
