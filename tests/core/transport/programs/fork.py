"""A process that forks while it has a session open; the fork says what happens when it opens one."""

import os
import sys

from joshua.plan import TransportSettings
from joshua.transport import TransportError, open_transport

spec = TransportSettings.model_validate_json(sys.argv[1])
transport = open_transport(spec)
child = os.fork()
if child == 0:
    try:
        open_transport(spec)
    except TransportError as error:
        print(error, flush=True)
    sys.exit()
code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
transport.close()
sys.exit(code)
