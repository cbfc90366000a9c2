"""For plugins that keep what was recorded: durable file operations, locks and the errors of a system."""

from joshua.plan.durable import NO_SPACE as NO_SPACE
from joshua.plan.durable import SYSTEM_ERRORS as SYSTEM_ERRORS
from joshua.plan.durable import FileLock as FileLock
from joshua.plan.durable import Files as Files
from joshua.plan.durable import LockTaken as LockTaken
from joshua.plan.durable import free_name as free_name
from joshua.plan.durable import is_system_error as is_system_error
from joshua.plan.durable import remedy as remedy
