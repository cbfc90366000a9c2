from joshua.schema import options_pb2 as _options_pb2
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from typing import ClassVar as _ClassVar, Mapping as _Mapping, Optional as _Optional, Union as _Union

DESCRIPTOR: _descriptor.FileDescriptor

class Comm(_message.Message):
    __slots__ = ("serial", "ble")
    SERIAL_FIELD_NUMBER: _ClassVar[int]
    BLE_FIELD_NUMBER: _ClassVar[int]
    serial: Serial
    ble: BLE
    def __init__(self, serial: _Optional[_Union[Serial, _Mapping]] = ..., ble: _Optional[_Union[BLE, _Mapping]] = ...) -> None: ...

class Serial(_message.Message):
    __slots__ = ("port", "baudrate", "serial_number", "vid_pid")
    PORT_FIELD_NUMBER: _ClassVar[int]
    BAUDRATE_FIELD_NUMBER: _ClassVar[int]
    SERIAL_NUMBER_FIELD_NUMBER: _ClassVar[int]
    VID_PID_FIELD_NUMBER: _ClassVar[int]
    port: str
    baudrate: int
    serial_number: str
    vid_pid: str
    def __init__(self, port: _Optional[str] = ..., baudrate: _Optional[int] = ..., serial_number: _Optional[str] = ..., vid_pid: _Optional[str] = ...) -> None: ...

class BLE(_message.Message):
    __slots__ = ("device_name", "service_uuid", "adapter")
    DEVICE_NAME_FIELD_NUMBER: _ClassVar[int]
    SERVICE_UUID_FIELD_NUMBER: _ClassVar[int]
    ADAPTER_FIELD_NUMBER: _ClassVar[int]
    device_name: str
    service_uuid: str
    adapter: str
    def __init__(self, device_name: _Optional[str] = ..., service_uuid: _Optional[str] = ..., adapter: _Optional[str] = ...) -> None: ...
