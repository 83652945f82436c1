"""The command line: parse, call, render. Importing it does not import JAX."""
