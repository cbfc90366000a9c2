"""Runs a plan in a process of its own, as the command line does: fork server first.

Arguments: path of the plan (JSON), folder of the logs, folder of the run directories. It prints one JSON
object a line.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

from joshua.supervisor import fork_server


def main() -> int:
    server = fork_server.start()
    show({"fork_server": server.process_id})
    from joshua.plan import Plan
    from joshua.supervisor.options import SupervisorOptions
    from joshua.supervisor.supervisor import Supervisor

    plan = Plan.model_validate_json(Path(sys.argv[1]).read_text())
    logs, runs = Path(sys.argv[2]), Path(sys.argv[3])
    options = SupervisorOptions(run_base=runs, log_directory=logs, log_level=10)
    try:
        report = Supervisor(plan, server, options, Printer()).run()
    finally:
        server.close()
    show({"exit_code": report.exit_code, "reason": report.reason})
    return report.exit_code


def show(record: dict[str, Any]) -> None:
    sys.stdout.write(json.dumps(record) + "\n")
    sys.stdout.flush()


class Printer:
    def on_table(self, table: Any) -> None:
        show({"ready": {row.full_name: row.process_id for row in table.nodes}})

    def on_status(self, status: Any) -> None:
        return

    def on_log(self, entry: Any) -> None:
        show({"log": entry.text, "node": entry.node, "level": entry.level_name})

    def on_event(self, event: Any) -> None:
        show({"event": event.kind, "node": event.node})

    def on_finish(self, report: Any) -> None:
        show({"reasons": {node.full_name: node.reason for node in report.nodes}})
        show({"states": {node.full_name: node.state for node in report.nodes}})


if __name__ == "__main__":
    sys.exit(main())
