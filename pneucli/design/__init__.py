"""From an identified model to a controller: surfaces, sliding sector, LMIs, compensation, cascade, closed loop."""
