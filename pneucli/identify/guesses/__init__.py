"""First guesses from the measurements alone, without a simulation."""
