"""Config to Plan, and the supervisor that runs a plan."""
