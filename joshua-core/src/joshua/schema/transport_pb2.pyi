from joshua.schema import options_pb2 as _options_pb2
from google.protobuf.internal import containers as _containers
from google.protobuf.internal import enum_type_wrapper as _enum_type_wrapper
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from typing import ClassVar as _ClassVar, Iterable as _Iterable, Mapping as _Mapping, Optional as _Optional, Union as _Union

DESCRIPTOR: _descriptor.FileDescriptor

class TransportKind(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    TRANSPORT_AUTO: _ClassVar[TransportKind]
    TRANSPORT_ZENOH: _ClassVar[TransportKind]
    TRANSPORT_DDS: _ClassVar[TransportKind]
    TRANSPORT_PLUGIN: _ClassVar[TransportKind]
TRANSPORT_AUTO: TransportKind
TRANSPORT_ZENOH: TransportKind
TRANSPORT_DDS: TransportKind
TRANSPORT_PLUGIN: TransportKind

class TransportConfig(_message.Message):
    __slots__ = ("kind", "domain_id", "listen_endpoints", "connect_endpoints", "tls", "network_interface", "peers", "plugin_kind", "open_to_local_users")
    KIND_FIELD_NUMBER: _ClassVar[int]
    DOMAIN_ID_FIELD_NUMBER: _ClassVar[int]
    LISTEN_ENDPOINTS_FIELD_NUMBER: _ClassVar[int]
    CONNECT_ENDPOINTS_FIELD_NUMBER: _ClassVar[int]
    TLS_FIELD_NUMBER: _ClassVar[int]
    NETWORK_INTERFACE_FIELD_NUMBER: _ClassVar[int]
    PEERS_FIELD_NUMBER: _ClassVar[int]
    PLUGIN_KIND_FIELD_NUMBER: _ClassVar[int]
    OPEN_TO_LOCAL_USERS_FIELD_NUMBER: _ClassVar[int]
    kind: TransportKind
    domain_id: int
    listen_endpoints: _containers.RepeatedScalarFieldContainer[str]
    connect_endpoints: _containers.RepeatedScalarFieldContainer[str]
    tls: TlsConfig
    network_interface: str
    peers: _containers.RepeatedScalarFieldContainer[str]
    plugin_kind: str
    open_to_local_users: bool
    def __init__(self, kind: _Optional[_Union[TransportKind, str]] = ..., domain_id: _Optional[int] = ..., listen_endpoints: _Optional[_Iterable[str]] = ..., connect_endpoints: _Optional[_Iterable[str]] = ..., tls: _Optional[_Union[TlsConfig, _Mapping]] = ..., network_interface: _Optional[str] = ..., peers: _Optional[_Iterable[str]] = ..., plugin_kind: _Optional[str] = ..., open_to_local_users: bool = ...) -> None: ...

class TlsConfig(_message.Message):
    __slots__ = ("root_ca_file", "certificate_file", "private_key_file")
    ROOT_CA_FILE_FIELD_NUMBER: _ClassVar[int]
    CERTIFICATE_FILE_FIELD_NUMBER: _ClassVar[int]
    PRIVATE_KEY_FILE_FIELD_NUMBER: _ClassVar[int]
    root_ca_file: str
    certificate_file: str
    private_key_file: str
    def __init__(self, root_ca_file: _Optional[str] = ..., certificate_file: _Optional[str] = ..., private_key_file: _Optional[str] = ...) -> None: ...
