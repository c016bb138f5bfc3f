"""Evaluation: the designed controller on the model, in scenarios, margins, Monte Carlo and logs."""
