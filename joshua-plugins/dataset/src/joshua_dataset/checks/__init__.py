"""The checks of data sets: one module for each part of a data set, and the problems that they find."""
