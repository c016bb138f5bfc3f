"""The compiled model: built from the effects' declarations, and run on recordings."""
