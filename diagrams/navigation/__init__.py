"""A mobile robot among obstacles by switching potentials."""
