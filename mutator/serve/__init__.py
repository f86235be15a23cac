"""A local server for reports, comparisons and reviews, with decisions and jobs. It needs the extra `serve`."""
