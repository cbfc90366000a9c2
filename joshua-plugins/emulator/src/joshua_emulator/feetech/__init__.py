"""The Feetech serial bus: packets, register table and servos of the STS family."""
