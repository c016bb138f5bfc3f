"""The designed controller and the maps for other programs: C, MATLAB, CSV."""
