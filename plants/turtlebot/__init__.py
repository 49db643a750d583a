"""The mobile robot of the switching potentials."""
