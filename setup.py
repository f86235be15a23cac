"""Compile the target's C code, and put the shipped library, templates and target into the wheel."""

import shutil
import sys
from pathlib import Path
from zipfile import ZipFile, ZipInfo

from setuptools import setup
from setuptools.command.bdist_wheel import bdist_wheel
from setuptools.command.build_py import build_py

CLONE = Path(__file__).resolve().parent
SHIPPED = ("target", "fault_library", "templates")
ARCHIVE = Path("mutator", "_common", "shipped.zip")  # where mutator/_common/shipped_files.py looks for it
COMPILER = "ziglang>=0.13"  # a C compiler from the package index for machines without one

sys.path.insert(0, str(CLONE / "target"))
sys.dont_write_bytecode = True  # keep bytecode out of the target's sources
from selfdrive.common import compiled  # noqa: E402
from selfdrive.common.errors import ConfigError  # noqa: E402
from selfdrive.sim.compile_helpers import COMPILED_FOLDER, compile_helpers, compiler_command  # noqa: E402


class BuildWithShipped(build_py):
    """Compiles helpers, builds the packages and, unless the install is editable, packs the shipped files."""

    def run(self) -> None:
        try:
            list(compile_helpers(COMPILED_FOLDER))
        except ConfigError as error:
            print(f"warning: {error}", file=sys.stderr)
        if not self.editable_mode:
            shutil.rmtree(self.build_lib, ignore_errors=True)  # drop modules of an earlier build
        super().run()
        if not self.editable_mode:
            archive = Path(self.build_lib) / ARCHIVE
            archive.parent.mkdir(parents=True, exist_ok=True)
            write_archive(archive)


class WheelOfOneMachine(bdist_wheel):
    """A wheel for any Python 3, but only for this platform if helpers were compiled."""

    def get_tag(self) -> tuple[str, str, str]:
        if not any(COMPILED_FOLDER.glob(f"*{compiled.SUFFIX}")):
            return super().get_tag()
        self.root_is_pure = False
        return "py3", "none", super().get_tag()[2]


def write_archive(path: Path) -> None:
    """Write an archive whose bytes depend only on its files. The wheel compresses it."""
    with ZipFile(path, "w") as archive:
        for file in sorted(file for folder in SHIPPED for file in (CLONE / folder).rglob("*")):
            name = file.relative_to(CLONE)
            hidden = any(part.startswith((".", "__pycache__")) for part in name.parts)
            if file.is_file() and not hidden and file.suffix != ".pyc":
                archive.writestr(ZipInfo(name.as_posix()), file.read_bytes())


setup(
    cmdclass={"build_py": BuildWithShipped, "bdist_wheel": WheelOfOneMachine},
    setup_requires=[] if compiler_command() else [COMPILER],
)
