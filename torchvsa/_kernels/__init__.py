"""Fast paths, each beside the plain line that it equals and with the command that measured it."""
