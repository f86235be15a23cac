"""The resources that one run may use."""

from dataclasses import dataclass, field

from mutator._common.hashing import added_field
from mutator._common.yaml_dataclasses import pydantic_mapping_config, yaml_metadata

MOST_LIMIT_OR_TIME = 1_000_000_000  # maximum of any limit or time


@dataclass(frozen=True, slots=True, kw_only=True)
class Limits:
    """The resources that one run can use before it is stopped."""

    __pydantic_config__ = pydantic_mapping_config("Limits")

    cpu_s: int = field(
        default=60,
        metadata=yaml_metadata(
            "CPU time in seconds. Without it, ten times that of the longest golden run, at least 10 s, "
            "rounded up to 20, 30, 60, 120, 300 s or a multiple of 300 s; `run.json` keeps the default.",
            ge=1,
            le=MOST_LIMIT_OR_TIME,
        ),
    )
    wall_s: int = field(
        default=300,
        metadata=yaml_metadata(
            "Wall time in seconds. Without it and `cpu_s`, at least five times the limit of CPU time.",
            ge=1,
            le=MOST_LIMIT_OR_TIME,
        ),
    )
    memory_mb: int = field(
        default=4096, metadata=yaml_metadata("Address space in MiB.", ge=256, le=MOST_LIMIT_OR_TIME)
    )
    steps: int = field(
        default=20_000, metadata=yaml_metadata("Number of simulation steps.", ge=1, le=MOST_LIMIT_OR_TIME)
    )
    disk_mb: int = added_field(
        1024,
        yaml_metadata(
            "MiB in the run's output folder and TMPDIR together; also the limit for each file.",
            ge=1,
            le=MOST_LIMIT_OR_TIME,
        ),
    )

    @property
    def cpu_limit_text(self) -> str:
        """The limit of CPU time, as the detail of a run that reached it says it."""
        return f"CPU time limit of {self.cpu_s} s"

    @property
    def wall_limit_text(self) -> str:
        """The limit of wall time, as the detail of a run that reached it says it."""
        return f"wall time limit of {self.wall_s} s"


@dataclass(frozen=True, slots=True, kw_only=True)
class MeasuredLimits(Limits):
    """Limits that follow from the CPU time of golden runs.

    Their texts have no number, because records must not depend on the speed of a machine.
    """

    @property
    def cpu_limit_text(self) -> str:
        return "CPU time limit, ten times the golden run's"

    @property
    def wall_limit_text(self) -> str:
        return "wall time limit"
