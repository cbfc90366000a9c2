"""The node of rotary encoders: a sensor node that checks the serial line in MODE_TEST."""

from __future__ import annotations

from joshua.api.nodes import SensorNode

from joshua_encoder.encoder import DAMAGED_SHARE, SerialEncoder


class EncoderNode(SensorNode):
    """Publishes the joints of one link."""

    def test_results(self) -> list[tuple[str, bool, str]]:
        """Return the rows of a sensor, then the condition of the line and the joint positions."""
        rows = super().test_results()
        if not isinstance(self._sensor, SerialEncoder):
            return rows
        encoder = self._sensor
        whole = encoder.counts > 0 and encoder.damaged <= max(1, DAMAGED_SHARE * encoder.counts)
        hint = "" if whole else ": check cable, ground and baudrate"
        rows.append(("line whole", whole, f"{encoder.counts} counts, {encoder.damaged} damaged{hint}"))
        rows += [(f"joint {name}", True, text) for name, text in encoder.joints()]
        return rows
