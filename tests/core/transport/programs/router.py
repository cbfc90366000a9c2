"""A process that hosts or joins the router until its input ends."""

import sys

from joshua.plan import TransportSpec
from joshua.transport.router import host_or_join

handle = host_or_join(TransportSpec.model_validate_json(sys.argv[1]))
assert handle is not None
print(handle.description, flush=True)
sys.stdin.read()
handle.close()
