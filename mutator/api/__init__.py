"""The public Python API, which the command line also calls. It never prints, asks questions or ends the
process.
"""
