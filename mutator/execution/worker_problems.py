"""What a worker reports when its work fails."""

import traceback

from mutator._common.resource_shortages import find_shortage
from mutator.errors import MutatorError


def reported_error(err: Exception) -> MutatorError | None:
    """Return the error to report to the user; None if it is a defect of the harness."""
    return err if isinstance(err, MutatorError) else find_shortage(err)


def describe_problem(err: Exception) -> str:
    """Return the message of an error to report, or the traceback of a defect."""
    return str(reported_error(err) or "".join(traceback.format_exception(err)).rstrip())
