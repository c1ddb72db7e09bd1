"""Runs that are ready to go, from a start, from a row of a table, or on from a checkpoint.

In: `model.Model` and settings
Out: `running.simulation_run.SimulationRun`: blocks of rows, an account
"""
