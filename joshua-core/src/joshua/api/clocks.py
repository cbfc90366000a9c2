"""Clocks: stamps from device time, telling a silent device from a busy computer, and ROS 2 time."""

from joshua.devices.stamps import StampClock as StampClock
from joshua.guardian.silence import AwakeClock as AwakeClock
from joshua.guardian.silence import witness as witness
from joshua.node import ros_time as ros_time
