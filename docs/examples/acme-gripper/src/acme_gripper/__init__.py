"""The ACME gripper, an example of a third party's plugin."""
