"""Units of the X series' registers."""

from joshua_emulator.joint import TICKS_PER_TURN

VELOCITY_TICKS_S = 0.229 * TICKS_PER_TURN / 60  # one unit of a velocity: 0.229 rev/min
ACCELERATION_TICKS_S2 = 214.577 * TICKS_PER_TURN / 3600  # one unit: 214.577 rev/min²
