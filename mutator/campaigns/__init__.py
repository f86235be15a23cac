"""Turn a campaign file into its frozen plan: experiments, sampling, filters, chunks and provenance.

This package does not run or judge experiments.
"""
