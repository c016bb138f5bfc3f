"""The identified plant as a Functional Mock-up Unit (FMI 3.0 or 2.0): C from the equations of the simulation."""
