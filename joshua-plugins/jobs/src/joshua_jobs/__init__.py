"""Jobs on many processes or machines."""
