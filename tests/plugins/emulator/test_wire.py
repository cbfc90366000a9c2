import pytest
from joshua_emulator.wire import WireClock


def test_a_byte_takes_ten_bits() -> None:
    wire = WireClock()
    assert wire.request(14, 1_000_000, 5.0) == pytest.approx(5.000140)
    assert wire.reply(8, 1_000_000, 0.0005) == pytest.approx(5.000140 + 0.0005 + 0.00008)


def test_the_line_is_half_duplex() -> None:
    wire = WireClock()
    wire.request(100, 1_000_000, 5.0)
    assert wire.request(10, 1_000_000, 5.0) == pytest.approx(5.0011)
    assert wire.request(10, 500_000, 6.0) == pytest.approx(6.0002)
