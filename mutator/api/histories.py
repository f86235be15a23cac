"""The history of a folder of runs."""

from mutator.report.history import History, is_folder_of_runs, write_history

__all__ = ["History", "is_folder_of_runs", "write_history"]
