"""The campaigns of the reproduction: shipped ones, with the changes that the study needs."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from mutator._common.files import make_folder, write_atomic
from mutator.config.yaml_files import load_yaml
from mutator.config.yaml_writing import yaml_text
from mutator.store.plan_choices import Choices
from mutator.workspace import Workspace

_FEW_FAULTS = 'scenario == "S1" and fault_type in ("jamming", "speed")'
WHOLE_PLAN = Choices()
LOWER_THRESHOLD = "coded_threshold_2_75"  # the change that sets the detector's other threshold


@dataclass(frozen=True, slots=True, kw_only=True)
class StudyCampaign:
    """A campaign of the study: a shipped one in a reading, with more changes of the setting or more seeds.

    `name` names its run folder and its rows in tables, `title` its columns on pages. `choices` are those of
    the run: the whole plan, except in a small study.
    """

    name: str
    title: str
    shipped_campaign: str
    reading: str
    setting_changes: tuple[str, ...] = ()
    seed_count: int = 1
    choices: Choices = WHOLE_PLAN

    @property
    def is_sample(self) -> bool:
        return self.seed_count > 1

    def small(self) -> "StudyCampaign":
        """Return the campaign with at most two seeds and a few faults."""
        seed_count = min(self.seed_count, 2)
        choices = Choices(only=_FEW_FAULTS, limit=8 * seed_count, proportional=True)
        return replace(self, seed_count=seed_count, choices=choices)

    def text(self, workspace: Workspace) -> str:
        """Return the campaign as YAML. The file may be anywhere, because it names nothing by path."""
        data = dict(load_yaml(workspace.campaign(self.shipped_campaign)).data)
        setting = data["setting"]
        if isinstance(setting, dict):
            setting = setting[self.reading]
        data |= {"name": f"study_{self.name}", "reading": self.reading}
        data["setting"] = [*setting, *self.setting_changes]
        if self.is_sample:
            data["seeds"] = {"from": data["seed"], "to": data.pop("seed") + self.seed_count - 1}
        return yaml_text(data)

    def write(self, workspace: Workspace, out: Path) -> Path:
        """Write the campaign into the folder of the study; return its file."""
        file = out / "campaigns" / f"{self.name}.yaml"
        make_folder(file.parent)
        write_atomic(file, self.text(workspace).encode())
        return file


STUDY: Sequence[StudyCampaign] = (
    StudyCampaign(name="described", title="as described", shipped_campaign="paper", reading="as_described"),
    StudyCampaign(name="coded", title="as coded", shipped_campaign="paper", reading="as_coded"),
    StudyCampaign(
        name="coded_2_75",
        title="as coded, threshold 2.75",
        shipped_campaign="paper",
        reading="as_coded",
        setting_changes=(LOWER_THRESHOLD,),
    ),
    StudyCampaign(
        name="reference",
        title="as coded, reference plant",
        shipped_campaign="paper_reference",
        reading="as_coded",
    ),
    StudyCampaign(
        name="reference_2_75",
        title="as coded, reference plant, threshold 2.75",
        shipped_campaign="paper_reference",
        reading="as_coded",
        setting_changes=(LOWER_THRESHOLD,),
    ),
    StudyCampaign(
        name="ten_seeds",
        title="as described, ten seeds of a tenth",
        shipped_campaign="paper_sample",
        reading="as_described",
        seed_count=10,
    ),
)
