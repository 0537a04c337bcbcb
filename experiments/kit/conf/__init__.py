"""Presets of config groups, and options whose values differ from the defaults of a class."""
