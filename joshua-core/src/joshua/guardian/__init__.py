"""The process that brings an actuator into its safe state when its driver cannot. Light to import."""
