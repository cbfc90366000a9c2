"""What a simulator puts in the place of devices."""

from joshua.plugins.sim_adapter import CoupledArm as CoupledArm
from joshua.plugins.sim_adapter import CoupledCamera as CoupledCamera
from joshua.plugins.sim_adapter import RealDevice as RealDevice
from joshua.plugins.sim_adapter import SimAdapterError as SimAdapterError
