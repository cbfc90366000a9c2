"""The program that runs on the hub: its source, what it was compiled to, and how it is packed."""
