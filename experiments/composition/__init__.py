"""How behaviours combine."""
