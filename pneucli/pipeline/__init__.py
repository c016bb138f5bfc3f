"""The graph of stages: their dependencies, which are stale and why, and how to bring them up to date safely."""
