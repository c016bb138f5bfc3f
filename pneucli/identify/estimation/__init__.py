"""Parameters by bounded least squares: problem, fit, intervals, correlation."""
