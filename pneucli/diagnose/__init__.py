"""Which physical effect is missing: screen, refit, hold out, and doubt."""
