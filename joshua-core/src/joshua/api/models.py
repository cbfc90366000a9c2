"""For trained models, beside ``Model``: settings, requirements, real-time chunking."""

from typing import TYPE_CHECKING

from joshua.plan import Compute as Compute
from joshua.plan import Execution as Execution
from joshua.plan import ModelNeeds as ModelNeeds
from joshua.plan.lazy import lazy_names
from joshua.plugins.model_settings import ModelContext as ModelContext
from joshua.plugins.model_settings import ModelSettings as ModelSettings

if TYPE_CHECKING:
    from joshua.models.model import ChunkRequest as ChunkRequest

#: Loaded at first use: checking settings does not need numpy.
__getattr__, __dir__ = lazy_names(__name__, {"joshua.models.model": ("ChunkRequest",)})
