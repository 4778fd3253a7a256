"""Top floor: one function per verb, the command line, resuming."""
