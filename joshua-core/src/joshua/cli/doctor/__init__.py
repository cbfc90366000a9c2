"""``joshua doctor``: what of this machine and its devices is in order, and what to do about the rest."""
