"""Raw files in, checked signals out; and the one way in which artifacts are written and read."""
