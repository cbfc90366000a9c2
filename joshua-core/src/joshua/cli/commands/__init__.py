"""One module per command, each with SUMMARY, add_arguments and run."""
