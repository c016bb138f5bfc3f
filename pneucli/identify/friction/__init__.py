"""Friction over velocity from recordings of a cylinder: measured curves, models A to F, and their simulation errors."""
