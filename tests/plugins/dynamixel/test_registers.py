from joshua.schema import config_pb2
from joshua.textproto.field_facts import field_facts
from joshua_dynamixel import registers
from joshua_dynamixel.models import MODELS, model_name
from joshua_emulator.dynamixel import models as emulated_models
from joshua_emulator.dynamixel import registers as emulated
from joshua_emulator.servo_bus.registers import Area
from joshua_servo.register import Register

DRIVER_TABLE = [value for value in vars(registers).values() if isinstance(value, Register)]


def test_driver_and_emulator_agree_though_they_share_no_code() -> None:
    assert len(DRIVER_TABLE) > 20
    for register in DRIVER_TABLE:
        other = emulated.BY_ADDRESS[register.address]
        assert (register.width, register.signed) == (other.width, other.signed), register.name
        assert register.eeprom == (other.area is Area.EEPROM), register.name
    assert registers.BAUDRATES == emulated.BAUDRATES
    assert {(m.name, m.number) for m in MODELS.values()} == {
        (m.name, m.number) for m in emulated_models.MODELS.values()
    }


def test_the_schema_allows_the_models_that_are_known() -> None:
    (facts,) = [f for f in field_facts(config_pb2.DynamixelConfig.DESCRIPTOR) if f.name == "models"]
    assert facts.allowed == tuple(MODELS)


def test_everything_that_is_read_has_registers() -> None:
    spanned = {address for first, end in registers.SPANS for address in range(first, end)}
    assert spanned <= emulated.DEFINED
    for address, length in (*registers.SETUP, registers.FEEDBACK):
        assert spanned.issuperset(range(address, address + length))


def test_models_have_names_and_loads() -> None:
    assert model_name(1190) == "xl330-m077"
    assert model_name(4711) == "model 4711"
    assert MODELS["xl330-m077"].load(-735) == -0.5
    assert MODELS["xl430-w250"].load(-500) == -0.5
    assert MODELS["xl430-w250"].current_a(-500) == 0.7


def test_negative_values_are_two_s_complements() -> None:
    assert registers.HOMING_OFFSET.encode(-3) == b"\xfd\xff\xff\xff"
    assert registers.HOMING_OFFSET.decode(b"\xfd\xff\xff\xff\x07") == -3
