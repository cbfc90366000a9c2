"""A plain Zenoh client that takes everything it can get: prints the first that it heard.

Arguments: the endpoint, the certificate of the authority, seconds to wait for the link, and optionally a
certificate with its key.
"""

import json
import sys
import time
from typing import Any

import zenoh

endpoint, authority, patience_s, *own = sys.argv[1:]
config = zenoh.Config()
tls: dict[str, Any] = {"root_ca_certificate": authority, "verify_name_on_connect": False}
if own:
    tls.update({"connect_certificate": own[0], "connect_private_key": own[1], "enable_mtls": True})
for key, value in (
    ("mode", "client"),
    ("connect/endpoints", [endpoint]),
    ("connect/timeout_ms", int(patience_s) * 1000),
    ("scouting/multicast/enabled", False),
    ("transport/link/tls", tls),
):
    config.insert_json5(key, json.dumps(value))
heard: list[str] = []
try:
    session: Any = zenoh.open(config)
except zenoh.ZError:
    print(json.dumps({"connected": False, "heard": []}), flush=True)
    sys.exit()
subscriber: Any = session.declare_subscriber("**", lambda sample: heard.append(str(sample.key_expr)))
end_s = time.monotonic() + 60
while time.monotonic() < end_s and not heard:
    time.sleep(0.02)
connected = bool(session.info.routers_zid())
print(json.dumps({"connected": connected, "heard": heard[:1]}), flush=True)
session.close()
