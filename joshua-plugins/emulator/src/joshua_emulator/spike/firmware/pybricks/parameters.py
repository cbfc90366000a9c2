"""Names of ports."""


class Port:
    """The ports of a SPIKE Prime hub."""

    A = "A"
    B = "B"
    C = "C"
    D = "D"
    E = "E"
    F = "F"
