"""Prints the nodes that a process finds within a second."""

import json
import sys
import time

from joshua.plan import TransportSettings
from joshua.transport import open_transport

transport = open_transport(TransportSettings.model_validate_json(sys.argv[1]))
time.sleep(1.0)
print(json.dumps(sorted(node.name for node in transport.nodes())), flush=True)
transport.close()
