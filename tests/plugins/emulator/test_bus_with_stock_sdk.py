"""The vendor's own Python SDK drives the emulator: a client that shares no code with it."""

import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
import scservo_sdk as sdk
from joshua_emulator import EmulatedBus, EmulatorError

PRESENT, GOAL, TORQUE, LOCK = 56, 42, 40, 55


ATTEMPTS = 8  # the SDK waits 34 ms for a reply, which a busy machine may exceed


class Client:
    """The stock SDK on one port."""

    def __init__(self, bus: EmulatedBus, baudrate: int = 1_000_000) -> None:
        self.bus = bus
        self.port = sdk.PortHandler(bus.port)
        assert self.port.openPort()
        assert self.port.setBaudRate(baudrate)
        self.packets = sdk.protocol_packet_handler()

    def settle(self) -> None:
        """Waits until the emulator has taken what was sent, and forgets replies that came too late.

        The SDK has no patience with a busy machine, and would take them for answers to its next request.
        """
        for _ in range(2):
            self.bus.ask("state")
            time.sleep(0.005)
        self.port.ser.reset_input_buffer()

    def ping(self, servo_id: int) -> int | None:
        for _ in range(ATTEMPTS):
            try:
                model, result, _ = self.packets.ping(self.port, servo_id)
            except IndexError:  # the SDK took a late reply for the answer to its next request
                result = sdk.COMM_RX_FAIL
            if result == sdk.COMM_SUCCESS:
                return int(model)
            self.settle()
        return None

    def word(self, servo_id: int, address: int) -> int:
        for _ in range(ATTEMPTS):
            try:
                value, result, _ = self.packets.read2ByteTxRx(self.port, servo_id, address)
            except IndexError:  # a late acknowledgement in place of the value
                result = sdk.COMM_RX_FAIL
            if result == sdk.COMM_SUCCESS:
                return int(value)
            self.settle()
        raise AssertionError(self.packets.getTxRxResult(result))

    def write(self, servo_id: int, address: int, *data: int) -> int:
        for _ in range(ATTEMPTS):
            result, error = self.packets.writeTxRx(self.port, servo_id, address, len(data), list(data))
            if result == sdk.COMM_SUCCESS:
                return int(error)
            self.settle()
        raise AssertionError(self.packets.getTxRxResult(result))

    def succeeds(self, request: Callable[[], int]) -> bool:
        """Whether a request is answered within some attempts."""
        for _ in range(ATTEMPTS):
            if request() == sdk.COMM_SUCCESS:
                return True
            self.settle()
        return False

    def wait_position(self, servo_id: int, ticks: int, timeout_s: float = 60.0) -> None:
        deadline_s = time.monotonic() + timeout_s
        while self.word(servo_id, PRESENT) != ticks:
            assert time.monotonic() < deadline_s

    def close(self) -> None:
        self.port.closePort()


@pytest.fixture
def bus() -> Iterator[EmulatedBus]:
    with EmulatedBus(ids=(1, 2, 3)) as bus:
        yield bus


@pytest.fixture
def client(bus: EmulatedBus) -> Iterator[Client]:
    client = Client(bus)
    yield client
    client.close()


def test_ping_finds_the_servos_and_nobody_else(client: Client) -> None:
    assert [client.ping(servo_id) for servo_id in (1, 2, 3, 4)] == [777, 777, 777, None]


def test_a_written_goal_is_reached(bus: EmulatedBus, client: Client) -> None:
    client.write(2, GOAL, 0xC4, 0x09)
    client.wait_position(2, 2500)
    assert bus.servo(2)["energised"]
    assert not bus.servo(1)["energised"]


def test_sync_write_and_sync_read(bus: EmulatedBus, client: Client) -> None:
    writer = sdk.GroupSyncWrite(client.port, client.packets, GOAL, 2)
    for servo_id, ticks in ((1, 2000), (2, 2100), (3, 2200)):
        writer.addParam(servo_id, [ticks & 0xFF, ticks >> 8])
    assert writer.txPacket() == sdk.COMM_SUCCESS
    for servo_id, ticks in ((1, 2000), (2, 2100), (3, 2200)):
        client.wait_position(servo_id, ticks)
    reader = sdk.GroupSyncRead(client.port, client.packets, PRESENT, 15)
    for servo_id in (1, 2, 3):
        reader.addParam(servo_id)
    assert client.succeeds(reader.txRxPacket)
    assert [reader.getData(servo_id, PRESENT, 2) for servo_id in (1, 2, 3)] == [2000, 2100, 2200]
    assert reader.getData(1, 62, 1) in range(115, 125)
    (entry,) = bus.log("sync_write")
    assert entry["wire_end_ns"] - entry["t_ns"] == (8 + 3 * 3) * 10_000  # ten bits a byte at 1 Mbit/s


def test_a_registered_write_waits_for_its_action(client: Client) -> None:
    assert client.succeeds(lambda: client.packets.regWriteTxRx(client.port, 1, GOAL, 2, [0, 9])[0])
    assert client.word(1, PRESENT) == 2048
    assert client.packets.action(client.port, sdk.BROADCAST_ID) == sdk.COMM_SUCCESS
    client.wait_position(1, 0x900)


def test_a_new_id_answers_and_outlives_the_process(tmp_path: Path) -> None:
    for servo_id, absent in ((1, 9), (9, 1)):
        with EmulatedBus(ids=(1,), eeprom=tmp_path / "eeprom.json") as bus:
            client = Client(bus)
            assert client.ping(servo_id) == 777
            assert client.ping(absent) is None
            client.write(servo_id, 5, 9)  # locked: dropped
            assert client.ping(servo_id) == 777
            client.write(servo_id, LOCK, 0)
            client.packets.write1ByteTxOnly(client.port, servo_id, 5, 9)  # asked twice, nobody would answer
            client.settle()
            client.close()


def test_another_line_speed_hears_nothing_until_the_servo_changes(client: Client) -> None:
    client.port.setBaudRate(500_000)
    assert client.ping(1) is None
    client.port.setBaudRate(1_000_000)
    client.write(1, LOCK, 0)
    client.packets.write1ByteTxOnly(client.port, 1, 6, 1)  # code of 500 kbit/s
    client.settle()
    assert client.ping(1) is None
    client.port.setBaudRate(500_000)
    assert client.ping(1) == 777
    assert client.ping(2) is None


def test_a_reply_is_never_ahead_of_its_wire_time(bus: EmulatedBus, client: Client) -> None:
    client.port.setBaudRate(1_000_000)
    slow = EmulatedBus(ids=(1,), baudrate=38_400, return_delay_s=500e-6)
    with slow:
        other = Client(slow, 38_400)
        start_s = time.monotonic()
        other.word(1, PRESENT)
        assert time.monotonic() - start_s >= (8 + 8) * 10 / 38_400 + 500e-6
        other.close()


def test_broadcast_writes_reach_all_without_a_reply(bus: EmulatedBus, client: Client) -> None:
    client.write(1, GOAL, 0, 9)
    client.packets.write1ByteTxOnly(client.port, sdk.BROADCAST_ID, TORQUE, 1)
    client.ping(1)  # answered after the write has been heard
    assert [servo["energised"] for servo in bus.servos()] == [True, True, True]


def test_faults_silent_duplicate_and_broken_chain(bus: EmulatedBus, client: Client) -> None:
    bus.fault("duplicate", 3)
    for _ in range(ATTEMPTS):
        _, result, _ = client.packets.read2ByteTxRx(client.port, 3, PRESENT)
        if result != sdk.COMM_RX_TIMEOUT:
            break
        client.settle()
    assert result == sdk.COMM_RX_CORRUPT
    bus.fault("silent", 1)
    assert [client.ping(servo_id) for servo_id in (1, 2, 3)] == [None, 777, 777]
    bus.ask("clear_faults")
    bus.fault("break_after", 2)
    assert [client.ping(servo_id) for servo_id in (1, 2, 3)] == [777, 777, None]


def test_line_faults(bus: EmulatedBus, client: Client) -> None:
    for kind, expected in (("drop", sdk.COMM_RX_TIMEOUT), ("drop_request", sdk.COMM_RX_TIMEOUT)):
        bus.fault(kind, 1.0)
        assert client.packets.read2ByteTxRx(client.port, 1, PRESENT)[1] == expected
        bus.ask("clear_faults")
    assert client.word(1, PRESENT) == 2048
    assert bus.ask("state")["fault_counts"]["drop"] == 1


def test_a_brown_out_takes_the_torque_off(bus: EmulatedBus, client: Client) -> None:
    client.write(1, GOAL, 0, 9)
    bus.fault("brown_out")
    entry = bus.wait_for(["brown_out"])
    assert not bus.servo(1)["energised"]
    torque = [e for e in bus.log("torque") if e["id"] == 1]
    assert [e["on"] for e in torque] == [True, False]
    assert entry["t_ns"] >= torque[0]["t_ns"]


def test_overload_and_temperature_show_in_the_error_byte(bus: EmulatedBus, client: Client) -> None:
    bus.fault("overload", 1)
    assert client.write(1, LOCK, 1) == 1 << 5
    bus.fault("over_temperature", 2)
    client.word(2, PRESENT)
    assert client.write(2, LOCK, 1) == 1 << 2


def test_an_echoing_adapter_returns_what_it_is_sent() -> None:
    with EmulatedBus(ids=(1,), echo=True) as bus:
        client = Client(bus)
        request = bytes.fromhex("ffff0104023802be")
        client.port.writePort(list(request))
        received = b""
        deadline_s = time.monotonic() + 60
        while len(received) < 16 and time.monotonic() < deadline_s:
            received += client.port.readPort(16 - len(received))
        assert received == request + bytes.fromhex("ffff0104000008f2")
        client.close()


def test_offset_calibration_by_the_torque_register(bus: EmulatedBus, client: Client) -> None:
    bus.hand({1: 700})
    client.write(1, TORQUE, 128)
    assert client.word(1, PRESENT) == 2048
    assert bus.servo(1)["homing_offset"] == 700 - 2048


def test_a_hand_moves_a_free_arm_and_not_one_under_torque(bus: EmulatedBus, client: Client) -> None:
    bus.hand({1: 1000, 2: 3000})
    assert (client.word(1, PRESENT), client.word(2, PRESENT)) == (1000, 3000)
    client.write(1, TORQUE, 1)
    with pytest.raises(EmulatorError, match="servo 1 holds with its torque on"):
        bus.hand({1: 1500})
