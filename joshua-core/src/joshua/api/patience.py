"""Patience with devices: telling a silent device from a delayed driver. Light to import, for safe stops."""

from joshua.guardian.silence import SILENCE_LIMIT_S as SILENCE_LIMIT_S
from joshua.guardian.silence import AwakeClock as AwakeClock
from joshua.guardian.silence import Patience as Patience
