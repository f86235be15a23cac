"""A local server for reports, comparisons and reviews, with decisions and jobs; needs the extra `serve`."""
