"""Our descriptors against the specification, message by message, number by number."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from google.protobuf.descriptor import FieldDescriptor
from joshua.schema import (
    calibration_pb2,
    comm_pb2,
    config_pb2,
    data_type_pb2,
    options_pb2,
    simulation_pb2,
    transport_pb2,
)
from joshua.schema.comments import comment
from joshua.schema.data_types import enum_names, type_name
from joshua.schema.descriptors import is_repeated

HERE = Path(__file__).parent
MODULES: tuple[Any, ...] = (
    calibration_pb2,
    comm_pb2,
    config_pb2,
    data_type_pb2,
    options_pb2,
    simulation_pb2,
    transport_pb2,
)
FILES = {
    "Comm": comm_pb2,
    "Serial": comm_pb2,
    "BLE": comm_pb2,
    "SimulationConfig": simulation_pb2,
    "MirrorTopicMapping": simulation_pb2,
}
# Fields for which 0 is a legal setting, so that «not written» must be told from 0.
OPTIONAL = {
    "STS3215Config.velocity",
    "STS3215Config.acceleration",
    "CameraConfig.brightness",
    "CameraConfig.contrast",
    "CameraConfig.saturation",
    "CameraConfig.exposure",
}
# Values in the order of the specification's tables; a documented default stands first and counts from 0.
ENUMS = {
    "OperationMode": "MODE_TELEOPERATE MODE_INFERENCE MODE_TRAINING MODE_CALIBRATION MODE_TEST "
    "MODE_DATA_STORE MODE_SIMULATION",
    "ActionType": "ACTION_LEADER ACTION_FOLLOWER ACTION_SINGLE ACTION_MOCK ACTION_SPIKE",
    "PerceptionType": "PERCEPTION_CAMERA PERCEPTION_ENCODER PERCEPTION_LIDAR",
    "ModelType": "RANDOM_NOISE SMOLVLA",
    "DataFormat": "FORMAT_HUGGINGFACE FORMAT_CSV FORMAT_JSONL FORMAT_PARQUET",
    "StorageBackend": "STORAGE_LOCAL STORAGE_CLOUD",
    "TrainingEnvironment": "ENV_SIMULATION ENV_REAL",
    "TrainingMethod": "METHOD_RL METHOD_IMITATION METHOD_EVAL",
    "SimulatorBackend": "BACKEND_MJX BACKEND_ISAAC",
    "NodeType": "CPP PYTHON",
    "SimulationMode": "INTERACTIVE PASSIVE MIRROR OFFSCREEN",
}
ENUMS_WITH_DEFAULT = {
    "Reliability": "RELIABLE BEST_EFFORT",
    "Durability": "VOLATILE TRANSIENT_LOCAL",
    "History": "KEEP_LAST KEEP_ALL",
    "Liveliness": "AUTOMATIC MANUAL_BY_TOPIC",
}
SCALARS = {
    FieldDescriptor.TYPE_INT32: "int32",
    FieldDescriptor.TYPE_FLOAT: "float",
    FieldDescriptor.TYPE_BOOL: "bool",
    FieldDescriptor.TYPE_STRING: "string",
}


def rows(name: str) -> list[str]:
    lines = (HERE / name).read_text(encoding="utf-8").splitlines()
    return [line for line in lines if line and not line.startswith("#")]


def message(name: str) -> Any:
    return FILES.get(name, config_pb2).DESCRIPTOR.message_types_by_name[name]


def enum(name: str) -> Any:
    module = simulation_pb2 if name == "SimulationMode" else config_pb2
    return module.DESCRIPTOR.enum_types_by_name[name]


def type_text(field: Any) -> str:
    if field.message_type is not None:
        name = field.message_type.name
    elif field.enum_type is not None:
        name = field.enum_type.name
    else:
        name = SCALARS[field.type]
    return f"repeated {name}" if is_repeated(field) else str(name)


@pytest.mark.parametrize("row", rows("specified_fields.txt"))
def test_a_specified_field_has_its_number_name_and_type(row: str) -> None:
    facts, _, oneof = row.partition(" in ")
    owner, number, name, wanted_type = facts.split(" ", 3)
    field = message(owner).fields_by_number[int(number)]
    assert field.name == name
    assert type_text(field) == wanted_type
    is_optional = f"{owner}.{name}" in OPTIONAL
    assert (field.containing_oneof.name if field.containing_oneof else "") == (
        f"_{name}" if is_optional else oneof
    )
    assert field.has_presence == (
        is_optional or bool(oneof) or field.message_type is not None
    ) or is_repeated(field)


def test_no_field_below_100_is_added_to_a_specified_message() -> None:
    specified = {tuple(row.split(" ")[:2]) for row in rows("specified_fields.txt")}
    for owner in {owner for owner, _ in specified}:
        numbers = {str(field.number) for field in message(owner).fields if field.number < 100}
        assert numbers == {number for name, number in specified if name == owner}


@pytest.mark.parametrize("name", [*ENUMS, *ENUMS_WITH_DEFAULT])
def test_a_specified_enum_counts_in_the_order_of_its_table(name: str) -> None:
    values = {value.name: value.number for value in enum(name).values if value.number < 100}
    if name in ENUMS:
        wanted = {value: number for number, value in enumerate(ENUMS[name].split(), 1)}
        zero = next(value for value, number in values.items() if number == 0)
        assert zero.endswith("_UNSPECIFIED")
        wanted[zero] = 0
    else:
        wanted = {value: number for number, value in enumerate(ENUMS_WITH_DEFAULT[name].split())}
    assert values == wanted


def test_the_data_type_enum_holds_all_types_under_their_numbers() -> None:
    wanted = {
        number: (type_name, name)
        for number, type_name, name in (row.split() for row in rows("data_types.txt"))
    }
    assert len(wanted) == 106
    for number, (ros_type, name) in wanted.items():
        assert type_name(int(number)) == ros_type
        assert enum_names(int(number))[0] == name
    values = {value.name: value.number for value in data_type_pb2.DataType.DESCRIPTOR.values}
    others = {name: number for name, number in values.items() if number and wanted[str(number)][1] != name}
    assert others == {"POSE2D": 18, "POINTCLOUD2": 62}
    assert values["DATA_TYPE_UNSPECIFIED"] == 0


def every_descriptor() -> list[Any]:
    found: list[Any] = []
    for module in MODULES:
        for one in module.DESCRIPTOR.message_types_by_name.values():
            found += [one, *one.fields]
        for one in module.DESCRIPTOR.enum_types_by_name.values():
            found += [one, *one.values]
    return found


@pytest.mark.parametrize(
    "descriptor", every_descriptor(), ids=lambda item: str(getattr(item, "full_name", item.name))
)
def test_each_message_field_enum_and_value_has_a_comment(descriptor: Any) -> None:
    assert comment(descriptor).endswith((".", "…")) or "/msg/" in comment(descriptor), comment(descriptor)


def test_a_binary_config_with_the_specified_numbers_reads_back() -> None:
    # general { mode: 1 robot_type: "SO-ARM100" }, by the specified numbers 1, 1 and 2.
    data = bytes((0x0A, 13, 0x08, 1, 0x12, 9)) + b"SO-ARM100"
    config = config_pb2.Config.FromString(data)
    assert config.general.mode == config_pb2.MODE_TELEOPERATE
    assert config.general.robot_type == "SO-ARM100"
    assert config.SerializeToString(deterministic=True) == data
