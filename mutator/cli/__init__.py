"""The command line: `mutator VERB`."""
