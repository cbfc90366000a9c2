"""``joshua doctor``: checks this machine and its devices, and names remedies."""
