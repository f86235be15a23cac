"""The public Python API, on which the command line is built. It never prints, asks questions or ends the
process.
"""
