"""A process that hosts or joins the router until its input ends."""

import sys

from joshua.plan import TransportSettings
from joshua.transport import prepare_transport

handle = prepare_transport(TransportSettings.model_validate_json(sys.argv[1]))
assert handle is not None
print(handle.description, flush=True)
sys.stdin.read()
handle.close()
