"""Compile the hub program: ``python -m joshua_spike.hub.build``, with ``mpy-cross-v6`` installed."""

from __future__ import annotations

import sys

from joshua_spike.hub.program import COMPILED, HASH_PLACEHOLDER, SMALL_INT_BITS, SOURCE, source_identity


def compile_program() -> bytes:
    """Return the compiled source. Raises RuntimeError with the compiler's message."""
    from mpy_cross_v6 import mpy_cross_compile

    source = SOURCE.read_text(encoding="utf-8")
    stamped = source.replace(HASH_PLACEHOLDER, source_identity(source))
    process, mpy = mpy_cross_compile(SOURCE.name, stamped, small_number_bits=SMALL_INT_BITS)
    if mpy is None:
        raise RuntimeError(f"{SOURCE}: {process.stderr.decode(errors='replace')}")
    return mpy


def main() -> int:
    """Write the compiled program next to its source."""
    COMPILED.write_bytes(compile_program())
    sys.stdout.write(f"{COMPILED}: {COMPILED.stat().st_size} bytes\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
