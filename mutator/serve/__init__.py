"""A local server for the pages of reports, comparisons and reviews, with decisions and jobs.

It shows pages made by `report`, `comparison` and `review`, and starts the command line for long work. It
needs the extra `serve`.
"""
