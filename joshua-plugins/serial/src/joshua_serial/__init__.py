"""Serial ports for device plugins: opening them, who holds them, and the lasting identity of USB adapters."""
