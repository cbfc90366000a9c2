"""What ``joshua estop`` does: one file for each way to reach a device."""
