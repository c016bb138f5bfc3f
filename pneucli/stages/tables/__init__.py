"""Artifacts and answers of the stages as tables."""
