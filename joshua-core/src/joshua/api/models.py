"""What trained models use beside ``Model``: their settings, what they need, chunks in real time."""

from joshua.models.model import ChunkRequest as ChunkRequest
from joshua.plan import Compute as Compute
from joshua.plan import ModelNeeds as ModelNeeds
from joshua.plugins.block_context import ModelContext as ModelContext
from joshua.plugins.settings import ModelSettings as ModelSettings
