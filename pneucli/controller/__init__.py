"""The controller that is simulated and exported: scalar code, translated to C and structured text."""
