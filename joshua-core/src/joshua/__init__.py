"""JOSHUA: one text file describes a robot and one command runs it."""
