"""Draw figures of results and runs from frames or traces. This package does not read run folders."""
