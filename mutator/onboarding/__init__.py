"""A first library for somebody's controller: what a source tree seems to be, read but never imported, and the
files that are written for it. What a target truly is, its manifest says; no campaign asks this package."""
