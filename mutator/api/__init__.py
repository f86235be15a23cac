"""The public Python API behind `import mutator`.

The command line calls what is here; nothing here prints.
"""
