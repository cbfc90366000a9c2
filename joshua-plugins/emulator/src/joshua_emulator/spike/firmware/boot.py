"""Starts an uploaded program as the hub does: ``micropython -X … boot.py REQUESTS ANSWERS FOLDER MODULE``."""

import sys

requests, answers, folder, module, modules = sys.argv[1:6]
sys.path.insert(0, modules)
sys.path.insert(0, folder)

from pybricks import wire  # noqa: E402

wire.open_pipes(int(requests), int(answers))
del sys.argv[1:]
__import__(module)
