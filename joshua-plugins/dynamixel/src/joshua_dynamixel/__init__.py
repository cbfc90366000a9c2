"""Driver for buses of Dynamixel X-series servos. Importing the package loads nothing."""
