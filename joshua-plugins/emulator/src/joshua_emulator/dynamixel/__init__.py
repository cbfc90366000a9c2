"""The Dynamixel bus: packets of protocol 2.0, control table and servos of the X series."""
