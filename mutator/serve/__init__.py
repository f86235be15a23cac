"""The pages of reports, comparisons and reviews from a local server, with decisions and jobs.

The server shows what `report`, `comparison` and `review` make, and starts the command line for what takes
long; nothing is worked out here. Needs the extra `serve`.
"""
