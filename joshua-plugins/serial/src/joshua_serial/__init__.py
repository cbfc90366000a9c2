"""Serial ports for device plugins: open ports, find their users, identify USB adapters permanently."""
