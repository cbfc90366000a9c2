"""For plugins that implement a whole node: base classes, publishers and the node's part of the plan."""

from joshua.devices.diagnostics import DiagnosticsPublisher as DiagnosticsPublisher
from joshua.devices.sensor_node import SensorNode as SensorNode
from joshua.node.behaviour import NodeBehaviour as NodeBehaviour
from joshua.node.cadence import DurationHistogram as DurationHistogram
from joshua.node.cadence import TrafficFigures as TrafficFigures
from joshua.node.endpoints import MessagePublisher as MessagePublisher
from joshua.node.endpoints import Outputs as Outputs
from joshua.node.errors import NodeError as NodeError
from joshua.node.extensions import ExtendedNode as ExtendedNode
from joshua.node.implementation import load_implementation as load_implementation
from joshua.node.verbs import Verb as Verb
from joshua.plan import ActuatorFacts as ActuatorFacts
from joshua.plan import ModelArm as ModelArm
from joshua.plan import ModelFacts as ModelFacts
from joshua.plan import SensorFacts as SensorFacts
from joshua.plan import ServiceFacts as ServiceFacts
from joshua.plan import TopicSpec as TopicSpec
