"""Files: durable operations and locks, paths checked before their use, and files of their owner alone."""

from joshua.plan.durable import NO_SPACE as NO_SPACE
from joshua.plan.durable import SYSTEM_ERRORS as SYSTEM_ERRORS
from joshua.plan.durable import FileLock as FileLock
from joshua.plan.durable import Files as Files
from joshua.plan.durable import LockTaken as LockTaken
from joshua.plan.durable import free_name as free_name
from joshua.plan.durable import is_system_error as is_system_error
from joshua.plan.durable import remedy as remedy
from joshua.plan.private_files import create_private as create_private
from joshua.plan.private_files import make_private as make_private
from joshua.plan.private_files import private_opener as private_opener
from joshua.plan.safe_paths import UnsafePathError as UnsafePathError
from joshua.plan.safe_paths import check_distinct as check_distinct
from joshua.plan.safe_paths import file_inside as file_inside
from joshua.plan.safe_paths import filled as filled
from joshua.plan.safe_paths import inside as inside
from joshua.plan.safe_paths import name_fault as name_fault
from joshua.plan.safe_paths import name_inside as name_inside
from joshua.plan.safe_paths import remove_tree as remove_tree
from joshua.plan.safe_paths import safe_name as safe_name
from joshua.plan.safe_paths import tree_inside as tree_inside
