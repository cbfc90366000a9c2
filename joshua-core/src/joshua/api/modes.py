"""The declaration of an operation mode that a plugin provides."""

from joshua.config.checks import Context as Context
from joshua.modes.queries import lacks as lacks
from joshua.modes.services import DATA_STORE as DATA_STORE
from joshua.modes.services import SIMULATION as SIMULATION
from joshua.modes.spec import ModeSpec as ModeSpec
from joshua.modes.spec import ServiceSpec as ServiceSpec
from joshua.plan.graph import ServiceTopic as ServiceTopic
