"""Base classes and helpers for transports of ROS 2 topics."""

from joshua.plan import QosProfile as QosProfile
from joshua.plan import TransportSettings as TransportSettings
from joshua.transport import open_transport as open_transport
from joshua.transport.delivery import Delivery as Delivery
from joshua.transport.transports import NAMELESS as NAMELESS
from joshua.transport.transports import Buffer as Buffer
from joshua.transport.transports import Emit as Emit
from joshua.transport.transports import Endpoint as Endpoint
from joshua.transport.transports import EndpointInfo as EndpointInfo
from joshua.transport.transports import NodeHandle as NodeHandle
from joshua.transport.transports import NodeInfo as NodeInfo
from joshua.transport.transports import Publisher as Publisher
from joshua.transport.transports import Sample as Sample
from joshua.transport.transports import ServiceInfo as ServiceInfo
from joshua.transport.transports import Subscription as Subscription
from joshua.transport.transports import Transport as Transport
from joshua.transport.transports import TransportError as TransportError
