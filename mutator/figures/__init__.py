"""Draw figures of results and runs from frames or traces. No statistics, no run folders."""
