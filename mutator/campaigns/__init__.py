"""Turns a campaign file into its frozen plan. This package does not run or judge experiments."""
