"""Stages: artifacts in, artifacts out; the only place where files and domain packages meet."""
