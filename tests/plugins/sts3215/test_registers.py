import pytest
import scservo_sdk as sdk
from hypothesis import given
from hypothesis import strategies as st
from joshua_emulator.feetech import registers as emulated
from joshua_emulator.servo_bus.registers import Area
from joshua_servo.register import Register
from joshua_sts3215 import registers
from joshua_sts3215.registers import GOAL_POSITION, HOMING_OFFSET, STATUS_BITS, StatusBit

DRIVER_TABLE = [value for value in vars(registers).values() if isinstance(value, Register)]


def test_driver_and_emulator_agree_though_they_share_no_code() -> None:
    for register in DRIVER_TABLE:
        if register is registers.FIRMWARE:
            continue  # two registers there
        other = emulated.BY_ADDRESS[register.address]
        assert (register.width, register.sign_bit) == (other.width, other.sign_bit), register.name
        assert register.eeprom == (other.area is Area.EEPROM), register.name
    assert registers.BAUDRATES == emulated.BAUDRATES
    assert registers.MODEL_NUMBER == emulated.MODEL_NUMBER


@given(st.integers(-2047, 2047))
def test_signed_values_match_the_vendors_sdk(value: int) -> None:
    data = HOMING_OFFSET.encode(value)
    raw = int.from_bytes(data, "little")
    assert raw == sdk.SCS_TOSCS(value, 11)
    assert HOMING_OFFSET.decode(data) == value == sdk.SCS_TOHOST(raw, 11)


@pytest.mark.parametrize("value", [2048, -2048])
def test_an_offset_that_does_not_fit_is_refused(value: int) -> None:
    with pytest.raises(ValueError, match=f"homing_offset accepts -2047 to 2047, found {value}"):
        HOMING_OFFSET.encode(value)


def test_unsigned_registers_refuse_negative_values() -> None:
    with pytest.raises(ValueError, match="lock accepts 0 to 255, found -1"):
        registers.LOCK.encode(-1)
    assert GOAL_POSITION.encode(-1) == b"\x01\x80"


def test_status_bits_have_names() -> None:
    assert STATUS_BITS.describe(0) == ""
    assert STATUS_BITS.describe(StatusBit.OVERLOAD | StatusBit.VOLTAGE) == "voltage out of range, overloaded"
    assert STATUS_BITS.describe(0x10) == "unknown bits 0x10"
