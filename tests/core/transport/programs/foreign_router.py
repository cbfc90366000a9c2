"""A Zenoh router of another user that admits everyone. Arguments: user id, port."""

import json
import os
import sys
from typing import Any

import zenoh

user, port = map(int, sys.argv[1:])
os.setgroups([])
os.setresgid(user, user, user)
os.setresuid(user, user, user)
config = zenoh.Config()
for key, value in (
    ("mode", "router"),
    ("listen/endpoints", [f"tcp/localhost:{port}"]),
    ("scouting/multicast/enabled", False),
    ("timestamping/enabled", True),
):
    config.insert_json5(key, json.dumps(value))
session: Any = zenoh.open(config)
print("ready", flush=True)
sys.stdin.read()
session.close()
