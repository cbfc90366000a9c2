"""Mend data sets that others damaged: what is there, what of it is whole, and the data set made of that."""
