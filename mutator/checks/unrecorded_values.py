"""Finds observed values that no channel records, so that nobody sees when a fault makes one NaN."""

from mutator.checks.check_findings import CheckState, Finding
from mutator.targets.manifest import TargetManifest

_FINDING_NAME = "observed values"


def unrecorded_values_finding(manifest: TargetManifest) -> Finding:
    """Name the values of `observation.values` without a channel of the same name."""
    recorded = {channel.name for channel in manifest.channels}
    names = [value.name for value in manifest.observation.values if value.name not in recorded]
    if not names:
        return Finding(name=_FINDING_NAME, level=CheckState.OK, found="channels record all of them")
    return Finding(
        name=_FINDING_NAME,
        level=CheckState.WARN,
        found=f"no channel has the name {' or '.join(names)}, so nobody sees it become NaN",
        remedy=f"add `{names[0]}` to `channels` of {manifest.path.name}; `from` is its name in the trace",
    )
