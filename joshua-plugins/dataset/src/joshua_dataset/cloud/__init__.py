"""Remote copies of data sets: on the Hugging Face Hub, in object stores, on any fsspec file system."""
