"""What the command tells its workers of golden runs whose checks pass while experiments run."""

from collections.abc import Mapping
from dataclasses import dataclass

from mutator._common.pickled_values import PickledValue


@dataclass(frozen=True, slots=True, kw_only=True)
class GoldenFacts(PickledValue):
    """What workers learn of golden runs whose checks have passed: the digests by key, the packages that they
    loaded, and the modules that no package provides.
    """

    digest_by_key: Mapping[str, str]
    packages: tuple[str, ...]
    modules_without_package: tuple[str, ...]
