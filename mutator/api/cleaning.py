"""What `mutator clean` calls: a run folder is deleted whole, or left alone."""

from mutator.store.cleaning import check
from mutator.store.cleaning import clean as delete

__all__ = ["check", "delete"]
