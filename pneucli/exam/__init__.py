"""Exams: cases with hidden effects from an independent virtual rig, and the grading of answers."""
