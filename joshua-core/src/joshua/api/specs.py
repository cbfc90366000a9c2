"""Specs of rarer plugins: emulators, environments, episode writers, modes and transports."""

from joshua.plugins.specs import EmulatorSpec as EmulatorSpec
from joshua.plugins.specs import Environment as Environment
from joshua.plugins.specs import EnvironmentSpec as EnvironmentSpec
from joshua.plugins.specs import EpisodeWriterSpec as EpisodeWriterSpec
from joshua.plugins.specs import ExtensionSpec as ExtensionSpec
from joshua.plugins.specs import ModeOffer as ModeOffer
from joshua.plugins.specs import TransportSpec as TransportSpec
