import errno
from pathlib import Path
from typing import Any

import pytest
from joshua_serial.errors import PortNotFound
from joshua_serial.usb_ports import Endpoint, list_ports, resolve


def plug(root: Path, name: str, serial: str, vid_pid: str = "1a86:55d3") -> str:
    """Lays out what a Linux host shows of one USB serial adapter."""
    usb = root / "sys/devices/pci/usb1" / f"1-{name}"
    node = usb / f"1-{name}:1.0" / "tty" / name
    node.mkdir(parents=True)
    (node / "device").symlink_to("../..")
    vendor, product = vid_pid.split(":")
    (usb / "idVendor").write_text(vendor + "\n")
    (usb / "idProduct").write_text(product + "\n")
    if serial:
        (usb / "serial").write_text(serial + "\n")
    for folder in ("sys/class/tty", "dev/serial/by-id"):
        (root / folder).mkdir(parents=True, exist_ok=True)
    (root / "sys/class/tty" / name).symlink_to(node)
    path = root / "dev" / name
    path.touch()
    (root / "dev/serial/by-id" / f"usb-Maker_{serial}-if00").symlink_to(f"../../{name}")
    return str(path)


def test_ports_are_listed_with_their_adapters(tmp_path: Path) -> None:
    left = plug(tmp_path, "ttyACM0", "L1")
    right = plug(tmp_path, "ttyUSB0", "R1", "0403:6001")
    (tmp_path / "sys/class/tty/ttyS0").mkdir()  # no USB device
    found = list_ports(str(tmp_path))
    assert [(p.path, p.serial_number, p.vid_pid) for p in found] == [
        (left, "L1", "1a86:55d3"),
        (right, "R1", "0403:6001"),
    ]
    assert found[0].by_id.endswith("usb-Maker_L1-if00")
    assert found[0].identity == "usb:L1"


def test_an_adapter_that_is_pulled_while_it_is_looked_at_is_left_out(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    plug(tmp_path, "ttyACM0", "L1")
    right = plug(tmp_path, "ttyACM1", "R1")
    read_text = Path.read_text

    def pulled(path: Path, *args: Any, **options: Any) -> str:
        if "ttyACM0" in str(path) and path.name == "product":
            raise OSError(errno.ENODEV, "No such device")
        return read_text(path, *args, **options)

    monkeypatch.setattr(Path, "read_text", pulled)
    (tmp_path / "sys/devices/pci/usb1/1-ttyACM0/product").touch()
    assert [port.path for port in list_ports(str(tmp_path))] == [right]


def test_an_adapter_is_found_by_serial_number_or_product(tmp_path: Path) -> None:
    left = plug(tmp_path, "ttyACM0", "L1")
    right = plug(tmp_path, "ttyACM1", "R1", "0403:6001")
    root = str(tmp_path)
    assert resolve(Endpoint(serial_number="R1", device_root=root)).path == right
    assert resolve(Endpoint(vid_pid="1A86:55D3", device_root=root)).path == left
    assert resolve(Endpoint(path=left, serial_number="R1", device_root=root)).path == right


def test_a_path_brings_its_identity_along(tmp_path: Path) -> None:
    plug(tmp_path, "ttyACM0", "L1")
    link = tmp_path / "dev" / "left_arm"
    link.symlink_to("ttyACM0")
    entry = resolve(Endpoint(str(link), device_root=str(tmp_path)))
    assert (entry.path, entry.identity) == (str(link), "usb:L1")


@pytest.mark.parametrize("identity", [{}, {"serial_number": "R1", "vid_pid": "1a86:55d3"}])
def test_an_adapter_at_its_path_is_found_without_reading_the_others(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, identity: dict[str, str]
) -> None:
    for number in range(3):
        plug(tmp_path, f"ttyACM{number}", f"L{number}")
    right = plug(tmp_path, "ttyACM3", "R1")
    read_text = Path.read_text
    read: list[Path] = []

    def noted(path: Path, *args: Any, **options: Any) -> str:
        read.append(path)
        return read_text(path, *args, **options)

    monkeypatch.setattr(Path, "read_text", noted)
    entry = resolve(Endpoint(right, device_root=str(tmp_path), **identity))
    assert (entry.path, entry.identity) == (right, "usb:R1")
    assert read
    assert all("ttyACM3" in str(path) for path in read)


def test_an_absent_adapter_is_named_with_the_ports_that_there_are(tmp_path: Path) -> None:
    plug(tmp_path, "ttyACM0", "L1")
    with pytest.raises(
        PortNotFound,
        match=r"R9: no adapter.*Ports here: .*ttyACM0 \(serial_number L1, vid_pid 1a86:55d3\).*find-port",
    ):
        resolve(Endpoint(serial_number="R9", device_root=str(tmp_path)))
    with pytest.raises(PortNotFound, match="Ports here: none"):
        resolve(Endpoint(serial_number="R9", device_root=str(tmp_path / "empty")))


def test_two_equal_adapters_need_a_serial_number(tmp_path: Path) -> None:
    plug(tmp_path, "ttyACM0", "L1")
    plug(tmp_path, "ttyACM1", "R1")
    with pytest.raises(
        PortNotFound, match=r"2 adapters match.*ttyACM0.*ttyACM1.*Add serial_number to the file"
    ):
        resolve(Endpoint(vid_pid="1a86:55d3", device_root=str(tmp_path)))


def test_adapters_that_share_a_serial_number_are_told_apart_by_their_path(tmp_path: Path) -> None:
    """Some makers give all of theirs one number; a guardian has to find the right one all the same."""
    left, right = plug(tmp_path, "ttyUSB0", "L1"), plug(tmp_path, "ttyUSB1", "R1")
    for path in tmp_path.rglob("serial"):
        if path.is_file():
            path.write_text("0001\n")
    root = str(tmp_path)
    for path_of_one in (left, right):
        found = resolve(Endpoint(path_of_one, "0001", "1a86:55d3", device_root=root))
        assert found.path == path_of_one
    with pytest.raises(PortNotFound, match=r"2 adapters match.*Add port to the file"):
        resolve(Endpoint(serial_number="0001", device_root=root))


def test_the_hosts_own_ports_can_be_listed() -> None:
    assert all(port.path.startswith("/dev/") for port in list_ports())


def test_an_adapter_that_moved_is_found_by_what_its_calibration_remembers(tmp_path: Path) -> None:
    root = str(tmp_path)
    moved = plug(tmp_path, "ttyACM4", "L1")
    gone = str(tmp_path / "dev/ttyACM0")
    assert resolve(Endpoint(gone, device_root=root, known_as="usb:L1")).path == moved
    assert resolve(Endpoint(gone, device_root=root, known_as="usb:R1")).path == gone
    assert resolve(Endpoint(gone, device_root=root)).path == gone
    other = plug(tmp_path, "ttyACM0", "R1")  # what stands at the path is not passed over in silence
    assert resolve(Endpoint(gone, device_root=root, known_as="usb:L1")).path == other
    assert Endpoint(gone, known_as="usb:L1").is_lasting
    assert not Endpoint(gone).is_lasting
    assert Endpoint("/dev/joshua/left_arm").is_lasting
    assert not Endpoint("/dev/cu.usbmodem5A").is_lasting
