"""The graph of stages: what depends on what, what is out of date and why, and the safe way to bring it up to date."""
