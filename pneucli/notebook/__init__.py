"""A run as a notebook sees it: artifacts as DataFrames, the model to be asked, and diagnoses of arrays.

``import pneucli`` gives what is here: :func:`~pneucli.notebook.run.open_run` as ``pneucli.open``,
:func:`~pneucli.notebook.simulation.simulate` and :func:`~pneucli.notebook.arrays.diagnose`. The command line stands on
it. Nothing heavy is imported before it is used.
"""
