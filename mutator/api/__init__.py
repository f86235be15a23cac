"""The public Python API behind `import mutator`, which the command line also calls.

Nothing here prints, asks questions or ends the process.
"""
