"""The configuration's protobuf modules, names of message types, and values of blocks."""

from joshua.plugins.block_values import block_values as block_values
from joshua.plugins.block_values import default_values as default_values
from joshua.schema import calibration_pb2 as calibration_pb2
from joshua.schema import config_pb2 as config_pb2
from joshua.schema import data_type_pb2 as data_type_pb2
from joshua.schema import data_types as data_types
from joshua.schema import simulation_pb2 as simulation_pb2
from joshua.schema.data_type_names import TYPE_NAMES as TYPE_NAMES
