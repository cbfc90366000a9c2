"""What ``joshua topic`` and ``joshua node`` share."""
