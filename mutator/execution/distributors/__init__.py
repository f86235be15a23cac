"""The ways to distribute work that `--cluster` names: one module for each, with a `DISTRIBUTOR`."""
