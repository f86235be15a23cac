"""The version, and the name under which pip knows the harness."""

VERSION = "0.2.0"
DISTRIBUTION = "mutator-fi"  # on the package index, `mutator` is another project
EARLIER_DISTRIBUTION = "mutator"  # what `pip` called the harness before; today, only another project


def extra_install_command(extra: str) -> str:
    """Return the command that adds an extra's packages to an installed harness."""
    return f"pip install '{DISTRIBUTION}[{extra}]'"
