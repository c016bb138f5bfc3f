"""The next experiment: candidate manoeuvres, limits of the rig, expected information, selection and power."""
