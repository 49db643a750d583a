"""The wire-driven snake of three bending modules on a translation."""
