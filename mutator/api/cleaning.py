"""Deletion of run folders, for `mutator clean`: completely, or not at all."""

from mutator.store.cleaning import check
from mutator.store.cleaning import clean as delete

__all__ = ["check", "delete"]
