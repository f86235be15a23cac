"""From a campaign file to its frozen plan: experiments, sampling, filters, chunks, provenance.

Nothing here runs an experiment or judges one.
"""
