"""The command line: each subcommand reads its options, calls the public API and prints the result."""
