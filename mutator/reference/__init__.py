"""The generated part of the documentation: pages and JSON Schemas, each from the one place that knows.

`python -m mutator.reference` writes all of it into the clone it is run in; a test holds what is committed
against what is generated.
"""
