"""Foreign text for people: control characters become visible, and secrets are masked."""

from joshua.plan.foreign_text import HIDDEN as HIDDEN
from joshua.plan.foreign_text import has_token as has_token
from joshua.plan.foreign_text import masked as masked
from joshua.plan.foreign_text import printable as printable
