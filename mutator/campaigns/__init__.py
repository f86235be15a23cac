"""From a campaign file to its frozen plan: experiments, sampling, filters, chunks, provenance.

This package does not run or judge experiments.
"""
