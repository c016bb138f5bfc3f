"""Synthesis: from an identified model and requirements to the parameters of a controller."""
