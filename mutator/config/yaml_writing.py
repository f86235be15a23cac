"""Write YAML that `load_yaml_model` reads: it refuses anchors and aliases."""

from typing import Any

import yaml


class _PlainDumper(yaml.SafeDumper):
    def ignore_aliases(self, data: Any) -> bool:
        return True


def yaml_text(data: Any) -> str:
    """Return YAML in which an object that occurs twice is written twice; keys keep their order."""
    text: str = yaml.dump(data, Dumper=_PlainDumper, sort_keys=False, allow_unicode=True, width=110)
    return text
