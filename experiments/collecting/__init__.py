"""Gather the runs below a folder into one table, and compare two runs or two values of a setting."""
