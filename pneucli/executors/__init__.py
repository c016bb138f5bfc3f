"""Run many jobs: in threads or processes of this machine, or on a Dask cluster.

The rigs of a fleet, the cases of an exam and the runs of a Monte Carlo study go through :func:`run_jobs`.
"""
