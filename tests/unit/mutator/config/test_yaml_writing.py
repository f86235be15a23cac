"""What is written can be read back."""

from pathlib import Path

from pydantic import BaseModel

from mutator.config.yaml_files import StrictModel, load_yaml_model
from mutator.config.yaml_writing import yaml_text


class _PlacesModel(StrictModel):
    first: dict[str, str]
    second: dict[str, str]


def test_an_object_that_occurs_twice_is_written_twice(tmp_path: Path) -> None:
    place = {"file": "a.py", "function": "é"}
    path = tmp_path / "places.yaml"
    path.write_text(yaml_text({"schema": "places/1", "second": place, "first": place}), encoding="utf-8")
    model, source = load_yaml_model(path, _PlacesModel, "places/1")
    assert isinstance(model, BaseModel) and model.first == model.second == place
    assert list(source.data) == ["schema", "second", "first"]
