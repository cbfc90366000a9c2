"""Driver for buses of Feetech/Waveshare STS3215 servos. Importing the package loads nothing."""
