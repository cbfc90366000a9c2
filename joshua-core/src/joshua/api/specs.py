"""What fewer plugins provide: emulators and training environments."""

from joshua.plugins.specs import EmulatorSpec as EmulatorSpec
from joshua.plugins.specs import Environment as Environment
from joshua.plugins.specs import EnvironmentSpec as EnvironmentSpec
