"""The public Python API behind `import mutator`: what the command line does is a call of what is here.

Nothing here prints, asks or ends the process; that is left to who calls.
"""
