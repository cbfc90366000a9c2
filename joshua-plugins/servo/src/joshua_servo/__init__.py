"""The common part of drivers for servo buses. A driver adds its protocol and its registers."""
