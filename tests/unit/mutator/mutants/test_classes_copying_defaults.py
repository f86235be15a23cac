"""Fields of classes that copy their defaults are refused with the reason."""

from pathlib import Path

import pytest

from mutator.mutants.classes_copying_defaults import reason_field_is_copied
from mutator.targets.source_tree import read_tree

FIELD = "    gain: float = -2.0\n"


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("from pydantic import BaseModel\nclass S(BaseModel):\n", "derives from BaseModel of pydantic"),
        (
            "import pydantic as p\nclass B(p.BaseModel):\n    x: int = 1\nclass S(B):\n",
            "BaseModel of pydantic",
        ),
        (
            "from pydantic_settings import BaseSettings as Base\nclass S(Base):\n",
            "BaseSettings of pydantic_settings",
        ),
        ("import msgspec\nclass S(msgspec.Struct, frozen=True):\n", "derives from Struct of msgspec"),
        ("from pydantic import *\nclass S(BaseModel):\n", "derives from BaseModel of pydantic"),
        (
            "from traitlets.config import Configurable\nclass S(Configurable):\n",
            "Configurable of traitlets.config",
        ),
        ("from django.db import models\nclass S(models.Model):\n", "Model of django.db.models"),
        ("from enum import IntEnum as E\nclass S(E):\n", "IntEnum of enum"),
        ("import enum\nclass S(metaclass=enum.EnumMeta):\n", "the metaclass enum.EnumMeta"),
        (
            "from typing import Generic\nimport pydantic\nclass S(pydantic.BaseModel, Generic[T]):\n",
            "BaseModel",
        ),
        (
            "from pydantic.dataclasses import dataclass\n@dataclass(frozen=True)\nclass S:\n",
            "decorated with pydantic",
        ),
        ("from other import Base\nclass S(Base[int]):\n", "BaseModel of pydantic"),
        ("import pkg.other as o\nclass S(o.Base):\n", "BaseModel of pydantic"),
    ],
)
def test_a_copying_ancestor_is_found(tmp_path: Path, text: str, words: str) -> None:
    """It is found through aliases, other classes and other files of the target."""
    (tmp_path / "m.py").write_text(text + FIELD)
    (tmp_path / "pkg").mkdir()
    for path in ("other.py", "pkg/other.py"):
        (tmp_path / path).write_text("from pydantic import BaseModel\nclass Base(BaseModel):\n    pass\n")
    assert words in str(reason_field_is_copied(read_tree(tmp_path, ["**"]), "m.py", "S", "gain"))


@pytest.mark.parametrize(
    "text",
    [
        "class S:\n",
        "from dataclasses import dataclass\n@dataclass(frozen=True)\nclass S:\n",
        "import attrs\n@attrs.define\nclass S:\n",
        "from abc import ABCMeta\nclass S(metaclass=ABCMeta):\n",
        "class BaseModel:\n    pass\nclass S(BaseModel):\n",
        "class S(S):\n",
        "try:\n    from msgspec import Struct\nexcept ImportError:\n    Struct = object\nclass S(Struct):\n",
    ],
)
def test_other_classes_keep_their_values(tmp_path: Path, text: str) -> None:
    """Values of ordinary classes, dataclasses and attrs classes can be set where they live."""
    (tmp_path / "m.py").write_text(text + FIELD)
    assert reason_field_is_copied(read_tree(tmp_path, ["**"]), "m.py", "S", "gain") is None


@pytest.mark.parametrize("annotation", ["ClassVar[float]", "typing.ClassVar", "'ClassVar[float]'"])
def test_a_class_variable_is_no_field(tmp_path: Path, annotation: str) -> None:
    """pydantic and msgspec leave it in the class, where it can be set."""
    text = f"from pydantic import BaseModel\nclass S(BaseModel):\n    limit: {annotation} = 2.0\n" + FIELD
    (tmp_path / "m.py").write_text(text)
    tree = read_tree(tmp_path, ["**"])
    assert reason_field_is_copied(tree, "m.py", "S", "limit") is None
    assert reason_field_is_copied(tree, "m.py", "S", "gain")
