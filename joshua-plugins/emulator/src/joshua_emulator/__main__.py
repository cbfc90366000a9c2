"""Run the emulator: ``python -m joshua_emulator feetech --ids 1-6``."""

import sys

from joshua_emulator.cli import main

if __name__ == "__main__":
    sys.exit(main())
