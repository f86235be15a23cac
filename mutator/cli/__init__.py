"""The command line: each verb reads its options, calls the public API and prints the result."""
