"""The workbench: one live page of a pipeline, on this machine, over the same functions and files as the commands.

Changes of the model run as the commands themselves, in processes of their own (:mod:`pneucli.workbench.commands`): the
page can end one at any moment as a killed command ends, and a fit never makes a slider wait. Only what follows the hand
is computed here (:mod:`pneucli.workbench.live_model`): the identified model with other values, on recordings that stay
in memory.
"""
