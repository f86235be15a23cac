"""Review of generated diffs: groups of mutants, decisions, the review page and the gate. This package
runs no experiments."""
