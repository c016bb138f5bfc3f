"""The independent virtual rig: its own equations and integrator, sharing nothing with the simulator under test."""
