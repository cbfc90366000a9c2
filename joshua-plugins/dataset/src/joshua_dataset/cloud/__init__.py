"""Copies of data sets elsewhere: on the Hugging Face Hub, in object stores, on any fsspec scheme."""
