"""The vendor's own Python SDK drives the emulator: a client that shares no code with it."""

import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import dynamixel_sdk as sdk
import pytest
from joshua_emulator import EmulatedBus, EmulatorError

PRESENT, GOAL, TORQUE, MODE, HARDWARE, VOLTAGE = 132, 116, 64, 11, 70, 144
ATTEMPTS = 8  # a busy machine may exceed the SDK's patience


class Client:
    """The stock SDK on one port."""

    def __init__(self, bus: EmulatedBus, baudrate: int = 1_000_000) -> None:
        self.bus = bus
        self.port = sdk.PortHandler(bus.port)
        assert self.port.openPort()
        assert self.port.setBaudRate(baudrate)
        self.packets = sdk.PacketHandler(2.0)

    def settle(self) -> None:
        """Waits until the emulator has taken what was sent, and forgets replies that came too late.

        The SDK has no patience with a busy machine, and would take them for answers to its next request.
        """
        for _ in range(2):
            self.bus.ask("state")
            time.sleep(0.005)
        self.port.ser.reset_input_buffer()

    def try_again(self, request: Callable[..., tuple[Any, ...]], *values: Any) -> tuple[Any, ...]:
        """The answer without the SDK's result, which is a success within some attempts."""
        for _ in range(ATTEMPTS):
            *answer, result, error = request(self.port, *values)
            if result == sdk.COMM_SUCCESS:
                return (*answer, error)
            self.settle()
        raise AssertionError(self.packets.getTxRxResult(result))

    def succeeds(self, request: Callable[[], int]) -> bool:
        """Whether a request is answered within some attempts."""
        for _ in range(ATTEMPTS):
            if request() == sdk.COMM_SUCCESS:
                return True
            self.settle()
        return False

    def read(self, servo_id: int, address: int, width: int = 4) -> int:
        readers = {
            1: self.packets.read1ByteTxRx,
            2: self.packets.read2ByteTxRx,
            4: self.packets.read4ByteTxRx,
        }
        return int(self.try_again(readers[width], servo_id, address)[0])

    def write(self, servo_id: int, address: int, value: int, width: int = 1) -> int:
        writers = {1: self.packets.write1ByteTxRx, 4: self.packets.write4ByteTxRx}
        return int(self.try_again(writers[width], servo_id, address, value)[-1])

    def wait_position(self, servo_id: int, ticks: int, timeout_s: float = 60.0) -> None:
        deadline_s = time.monotonic() + timeout_s
        while self.read(servo_id, PRESENT) != ticks:
            assert time.monotonic() < deadline_s


@pytest.fixture
def bus() -> Iterator[EmulatedBus]:
    with EmulatedBus("dynamixel", ids=(1, 2, 3), models=("xl330-m077", "xl430-w250")) as bus:
        yield bus


@pytest.fixture
def client(bus: EmulatedBus) -> Iterator[Client]:
    client = Client(bus)
    yield client
    client.port.closePort()


def test_ping_and_broadcast_ping(client: Client) -> None:
    assert client.try_again(client.packets.ping, 1) == (1190, 0)
    client.settle()
    assert client.packets.ping(client.port, 9)[1] == sdk.COMM_RX_TIMEOUT
    for _ in range(ATTEMPTS):
        client.settle()
        found, result = client.packets.broadcastPing(client.port)
        if result == sdk.COMM_SUCCESS and len(found) == 3:
            break
    assert found == {1: [1190, 46], 2: [1060, 46], 3: [1060, 46]}


def test_a_written_goal_is_reached_and_an_eeprom_write_refused(bus: EmulatedBus, client: Client) -> None:
    assert client.write(1, TORQUE, 1) == 0
    assert client.write(1, GOAL, 3000, 4) == 0
    client.wait_position(1, 3000)
    assert bus.servo(1)["energised"]
    assert client.write(1, MODE, 4) == sdk.ERRNUM_ACCESS
    assert client.write(1, GOAL, 5000, 4) == sdk.ERRNUM_DATA_LIMIT


def test_sync_write_sync_read_and_bulk_read(bus: EmulatedBus, client: Client) -> None:
    bus.hand({1: 1000, 2: 1500, 3: 2000})
    reader = sdk.GroupSyncRead(client.port, client.packets, PRESENT, 4)
    bulk = sdk.GroupBulkRead(client.port, client.packets)
    for servo_id, (address, width) in zip((1, 2, 3), ((PRESENT, 4), (VOLTAGE, 2), (0, 2)), strict=True):
        assert reader.addParam(servo_id)
        assert bulk.addParam(servo_id, address, width)
    assert client.succeeds(reader.txRxPacket)
    assert [reader.getData(i, PRESENT, 4) for i in (1, 2, 3)] == [1000, 1500, 2000]
    assert client.succeeds(bulk.txRxPacket)
    assert bulk.getData(1, PRESENT, 4) == 1000
    assert bulk.getData(2, VOLTAGE, 2) == 120
    assert bulk.getData(3, 0, 2) == 1060
    bus.hand({1: 1100})
    assert client.succeeds(reader.fastSyncRead)
    assert [reader.getData(i, PRESENT, 4) for i in (1, 2, 3)] == [1100, 1500, 2000]
    bus.hand({1: 1000})
    assert client.succeeds(bulk.fastBulkRead)
    assert [bulk.getData(1, PRESENT, 4), bulk.getData(2, VOLTAGE, 2), bulk.getData(3, 0, 2)] == [
        1000,
        120,
        1060,
    ]
    bus.fault("silent", 2)
    assert reader.fastSyncRead() != sdk.COMM_SUCCESS, "the packet breaks off"
    bus.ask("clear_faults")
    writer = sdk.GroupSyncWrite(client.port, client.packets, GOAL, 4)
    for servo_id in (1, 3):
        assert writer.addParam(servo_id, [0x00, 0x04, 0, 0])
    assert writer.txPacket() == sdk.COMM_SUCCESS
    client.read(1, GOAL)
    assert [servo["goal_position"] for servo in bus.servos()] == [1024, 2048, 1024]


def test_a_hardware_error_shows_in_each_reply_until_a_reboot(bus: EmulatedBus, client: Client) -> None:
    client.write(1, TORQUE, 1)
    bus.fault("overload", 1)
    assert client.try_again(client.packets.read1ByteTxRx, 1, HARDWARE) == (1 << 5, sdk.ERRBIT_ALERT)
    assert client.read(1, TORQUE, 1) == 0
    assert client.write(1, TORQUE, 1) == sdk.ERRBIT_ALERT | sdk.ERRNUM_RESULT_FAIL
    assert client.try_again(client.packets.reboot, 1) in ((0,), (sdk.ERRBIT_ALERT,))
    deadline_s = time.monotonic() + 60
    while client.packets.ping(client.port, 1)[1:] != (sdk.COMM_SUCCESS, 0):
        assert time.monotonic() < deadline_s
    assert client.write(1, TORQUE, 1) == 0


def test_positions_with_a_stuffed_byte(bus: EmulatedBus, client: Client) -> None:
    """A position of -3 has the bytes FD FF FF FF, and two of them in one read hold a header."""
    client.write(1, MODE, 4)
    bus.ask("set_register", id=1, name="homing_offset", value=-3 - 2048)
    for value in (-3, -2):
        bus.ask("set_register", id=1, name="homing_offset", value=value - 2048)
        data, _ = client.try_again(client.packets.readTxRx, 1, 128, 12)
        assert int.from_bytes(bytes(data[4:8]), "little", signed=True) == value


def test_a_status_level_of_one_answers_reads_only(client: Client) -> None:
    client.packets.write1ByteTxOnly(client.port, 1, 68, 1)  # its answer comes once, perhaps late
    client.settle()
    assert client.read(1, 68, 1) == 1
    client.settle()
    assert client.packets.write1ByteTxRx(client.port, 1, TORQUE, 1)[0] == sdk.COMM_RX_TIMEOUT
    assert client.read(1, TORQUE, 1) == 1


def test_the_eeprom_outlives_the_process(tmp_path: Path) -> None:
    options = {"eeprom": tmp_path / "eeprom.json", "models": ("xm430-w350",)}
    with EmulatedBus("dynamixel", ids=(1,), **options) as bus:
        client = Client(bus)
        client.packets.write1ByteTxOnly(client.port, 1, 7, 5)  # asked twice, nobody would answer to 1
        client.settle()
        client.port.closePort()
    for _ in range(2):  # a start that changes nothing keeps what is there
        with EmulatedBus("dynamixel", ids=(1,), **options) as bus:
            assert bus.servo(5)["present_voltage"] == 120
    with EmulatedBus("dynamixel", ids=(1,), **{**options, "models": ("xl330-m077",)}) as bus:
        assert bus.servo(1)["present_voltage"] == 50  # another model in its place is another servo


def test_a_reply_is_never_ahead_of_its_wire_time(bus: EmulatedBus, client: Client) -> None:
    bus.ask("set_register", name="return_delay", value=250)
    start_s = time.perf_counter()
    for _ in range(20):
        client.packets.read4ByteTxRx(client.port, 1, PRESENT)
    wire_s = (14 + 15) * 10 / 1_000_000 + 500e-6
    assert time.perf_counter() - start_s >= 20 * wire_s


def test_line_faults_and_silent_and_double_ids(bus: EmulatedBus, client: Client) -> None:
    bus.fault("corrupt", 1.0)
    assert client.packets.ping(client.port, 1)[1] != sdk.COMM_SUCCESS
    bus.ask("clear_faults")
    bus.fault("silent", 2)
    assert client.packets.ping(client.port, 2)[1] == sdk.COMM_RX_TIMEOUT
    bus.fault("duplicate", 1)
    client.settle()
    assert client.packets.read4ByteTxRx(client.port, 1, PRESENT)[1] != sdk.COMM_SUCCESS
    bus.fault("brown_out", 3)
    assert bus.log("brown_out")[-1]["id"] == 3


def test_an_unknown_model_is_refused() -> None:
    with pytest.raises(EmulatorError, match=r"model 'xl331' is not emulated; allowed: xl330-m077, "):
        EmulatedBus("dynamixel", ids=(1,), models=("xl331",)).start()
