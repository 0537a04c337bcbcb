"""Fast paths. Each states the plain line that it equals and the command that measured it."""
