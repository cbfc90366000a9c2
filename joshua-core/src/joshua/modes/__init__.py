"""One file per operation mode: which nodes, blocks and runs it needs, and its checks."""
