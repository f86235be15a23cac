"""A stranger's library with tricks that would reach the user's files, next to the user's own folder."""

import os
import shutil
import socket
import stat
from collections.abc import Callable
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path

from mutator.workspace import Workspace

TOY = Path(__file__).parents[1] / "toy"
TEMPLATES = Path(__file__).parents[2] / "templates"
SECRET = "what others must not read"
Trick = Callable[["World"], None]
State = dict[str, tuple[object, ...]]


@dataclass(frozen=True)
class World:
    """`mine` is the user's folder, `got` what came from somebody else, `out` what commands may write to."""

    root: Path

    @classmethod
    def build(cls, root: Path) -> "World":
        world = cls(root)
        for name in ("folder", "empty"):
            (world.mine / name).mkdir(parents=True)
        shutil.copytree(TOY, world.got, ignore=shutil.ignore_patterns("__pycache__", "templates"))
        shutil.rmtree(world.library / "faults" / "hostile")
        shutil.copytree(TEMPLATES, world.templates)
        world.out.mkdir()
        (world.library / "overlays").mkdir()
        (world.mine / "notes.txt").write_text(SECRET)
        for place in (world.mine, world.mine / "folder"):
            (place / "setup.py").write_text(f"SECRET = '{SECRET}'\n")
            for name in ("toycar", "lane", "A", "toy", "readings", "hazards", "near_far", "offset"):
                (place / f"{name}.yaml").write_text(f"{SECRET}: [\n")
                (place / f"{name}.py.j2").write_text(f"{SECRET}\n")
        return world

    @property
    def mine(self) -> Path:
        return self.root / "mine"

    @property
    def got(self) -> Path:
        return self.root / "got"

    @property
    def out(self) -> Path:
        return self.root / "out"

    @property
    def library(self) -> Path:
        return self.got / "fault_library"

    @property
    def templates(self) -> Path:
        return self.got / "templates"

    @property
    def tree(self) -> Path:
        return self.got / "tree"

    @property
    def workspace(self) -> Workspace:
        return Workspace(library=self.library, templates=self.templates)

    def link(self, name: str, end: Path) -> None:
        """Replace a file or folder of the stranger's folder with a link."""
        path = self.got / name
        path.parent.mkdir(parents=True, exist_ok=True)
        if path.is_dir():
            shutil.rmtree(path)
        path.unlink(missing_ok=True)
        path.symlink_to(end)

    def edit(self, name: str, old: str, new: str) -> None:
        path = self.library / name
        text = path.read_text()
        assert old in text, (name, old)
        path.write_text(text.replace(old, new, 1))

    def state(self, *, without: str | None = None) -> State:
        """Everything in the user's and the stranger's folder, but for one folder of the library."""
        found: State = {}
        for place in (self.mine, self.got):
            for folder, inner, names in os.walk(place):
                if without:
                    inner[:] = [name for name in inner if Path(folder, name) != self.library / without]
                for path in (Path(folder, name) for name in (*inner, *names)):
                    facts = path.lstat()
                    small = stat.S_ISREG(facts.st_mode) and facts.st_size < 1_000_000
                    content = sha256(path.read_bytes()).hexdigest() if small else ""
                    end = str(path.readlink()) if path.is_symlink() else ""
                    found[str(path)] = (facts.st_mode, facts.st_size, content, end)
        return found

    def leaks(self) -> list[Path]:
        """The files below `out` that contain the user's secret."""
        return [
            path
            for path in self.out.rglob("*")
            if path.is_file() and (path.is_symlink() or SECRET.encode() in path.read_bytes())
        ]


MANIFEST = "targets/toycar.yaml"
_LINKED = (  # in the stranger's folder
    "fault_library/targets/toycar.yaml",
    "fault_library/faults/sensor/lane.yaml",
    "fault_library/scenarios/A.yaml",
    "fault_library/campaigns/toy.yaml",
    "fault_library/readings.yaml",
    "fault_library/stpa/hazards.yaml",
    "fault_library/stpa/contexts/near_far.yaml",
    "templates/offset.yaml",
    "templates/offset.py.j2",
)
_FOLDERS = (
    "fault_library/targets",
    "fault_library/faults",
    "fault_library/faults/sensor",
    "fault_library/scenarios",
    "fault_library/campaigns",
    "fault_library/stpa",
    "fault_library/stpa/contexts",
    "fault_library/reviews",
    "fault_library/reviews/seen",
    "fault_library/severity",
    "fault_library/references",
    "tree/toycar/linked",
)
_EDITS = {
    "a target named ../..": (MANIFEST, "name: toycar", 'name: "../../../mine/toycar"'),
    "a target named /": (MANIFEST, "name: toycar", "name: /tmp/toycar"),
    "a change named ..": (MANIFEST, "alone:", '"/../../../../mine/x":'),
    "files ../**": (MANIFEST, '["toycar/**/*.py"]', '["toycar/**/*.py", "../../mine/**"]'),
    "files of /": (MANIFEST, '["toycar/**/*.py"]', '["toycar/**/*.py", "/etc/host*"]'),
    "an argument below ..": (
        MANIFEST,
        'args: ["{scenario}"',
        'args: ["{scenario}", "{root}/../../mine/notes.txt"',
    ),
    "a trace in ..": (MANIFEST, "file: log.npz", "file: ../../../mine/log.npz"),
    "a record in ..": (MANIFEST, "record: said.json", "record: ../../../mine/said.json"),
    "a root with NUL": (MANIFEST, "root: ../../tree", 'root: "../../tree\\0"'),
    "a package named ..": (MANIFEST, "package: toycar", "package: ../toycar"),
    "a module named ..": (MANIFEST, "module: toycar.go", "module: ....mine.setup"),
    "an overlay in ..": (MANIFEST, "package: toycar\n", "package: toycar\noverlay: ../../../mine\n"),
    "an observation in ..": (MANIFEST, "{file: toycar/go.py", "{file: ../../mine/setup.py"),
    "a root elsewhere": (MANIFEST, "root: ../../tree", "root: ../../../mine"),
    "a scale elsewhere": (MANIFEST, "hazards:", "severity: {scale: ../../../mine/A}\nhazards:"),
    "a fault in ..": ("faults/sensor/lane.yaml", "{file: toycar/sensing.py", "{file: ../../mine/setup.py"),
    "a template in ..": ("faults/sensor/lane.yaml", "model: offset", "model: ../../mine/offset"),
    "a campaign of a path": ("campaigns/toy.yaml", "target: toycar", "target: ../mine/toycar.yaml"),
    "a scenario of a path": ("campaigns/toy.yaml", "[A, B]", "[A, ../mine/A.yaml]"),
    "a table of a path": ("campaigns/toy.yaml", "table: near_far", "table: ../mine/near_far.yaml"),
    "a spec of a path": ("campaigns/toy.yaml", "  - spec: sensor/*", "  - spec: ../../../mine/lane.yaml"),
    "a study elsewhere": ("campaigns/toy.yaml", "target: toycar", "target: toycar\nstudy: ../mine/setup"),
    "formulas of mathematics": ("campaigns/toy.yaml", "name: toy", "name: $\\bad$"),
}
_NAMES = {
    "dots": "...yaml",
    "hidden": ".yaml",
    "right to left": "A\u202elmay.yaml",
    "a new line": "A\nB.yaml",
    "an escape": "A\x1b[2J.yaml",
    "composed": "\u00e4.yaml",
    "decomposed": "a\u0308.yaml",
    "a dollar": "$x_$.yaml",
    "another case": "a.yaml",
    "an option": "--help.yaml",
    "no UTF-8": "A\udcff.yaml",
}


def _edited(name: str) -> Trick:
    return lambda world: world.edit(*_EDITS[name])


def _named(name: str) -> Trick:
    def trick(world: World) -> None:
        for folder in ("scenarios", "campaigns", "faults/sensor", "targets"):
            files = sorted((world.library / folder).glob("*.yaml"))
            (world.library / folder / _NAMES[name]).write_bytes(files[0].read_bytes())

    return trick


def _pipe(name: str) -> Trick:
    def trick(world: World) -> None:
        (world.got / name).unlink(missing_ok=True)
        os.mkfifo(world.got / name)

    return trick


def _device(world: World) -> None:
    path = world.library / "scenarios" / "A.yaml"
    path.unlink()
    if os.geteuid() == 0:
        os.mknod(path, stat.S_IFCHR | 0o666, os.makedev(1, 5))  # /dev/zero
    else:
        path.symlink_to("/dev/zero")


def _socket(world: World) -> None:
    path = world.library / "campaigns" / "toy.yaml"
    path.unlink()
    here = Path.cwd()
    os.chdir(path.parent)  # the name of a socket must be short
    try:
        socket.socket(socket.AF_UNIX).bind(path.name)
    finally:
        os.chdir(here)


def _sparse(name: str) -> Trick:
    def trick(world: World) -> None:
        path = world.got / name
        path.touch()
        os.truncate(path, 40_000_000_000)

    return trick


def _loop(world: World) -> None:
    world.link("fault_library/faults/loop", Path())
    world.link("fault_library/scenarios/A.yaml", Path("A.yaml"))
    world.link("tree/toycar/loop", Path())


def _link(name: str, end: str) -> Trick:
    """Link a name of the stranger's folder to an absolute path, or to a name in the user's folder."""
    return lambda world: world.link(name, world.mine / end)


_REVIEW = "fault_library/reviews/toycar.yaml"
_SCENARIO = "fault_library/scenarios/A.yaml"
TRICKS: dict[str, Trick] = {
    **{f"{name} linked": _link(name, Path(name).name) for name in _LINKED},
    **{f"{name}/ linked": _link(name, "folder") for name in _FOLDERS},
    "reviews linked": _link(_REVIEW, "toycar.yaml"),
    "a new review linked": _link(_REVIEW, "new.yaml"),
    "a source linked": _link("tree/toycar/more.py", "setup.py"),
    "/ linked": _link("tree/toycar/linked", "/"),
    "the environment linked": _link(_SCENARIO, "/proc/self/environ"),
    "zeros linked": _link(_SCENARIO, "/dev/zero"),
    "a template linked": _link("templates/.env.j2", "notes.txt"),
    **{name: _edited(name) for name in _EDITS},
    **{f"a name with {name}": _named(name) for name in _NAMES},
    "a scenario is a pipe": _pipe(_SCENARIO),
    "a source is a pipe": _pipe("tree/toycar/more.py"),
    "a template is a pipe": _pipe("templates/offset.py.j2"),
    "readings are a pipe": _pipe("fault_library/readings.yaml"),
    "a scenario is a device": _device,
    "a campaign is a socket": _socket,
    "a huge scenario": _sparse(_SCENARIO),
    "a huge spec": _sparse("fault_library/faults/sensor/lane.yaml"),
    "loops": _loop,
}

MODULES = (  # that Python, pytest, the harness or a worker would import if they looked there
    *(
        "json",
        "_pytest",
        "pytest",
        "xdist",
        "execnet",
        "numpy",
        "yaml",
        "matplotlib",
        "typer",
        "mutator",
        "site",
    ),
    *("sitecustomize", "usercustomize", "conftest", "encodings", "linecache", "readline", "_fi"),
)
_RC_FILES = {
    "matplotlibrc": "axes.facecolor: red\nbackend: module://json\ntext.usetex: True\n",
    ".pdbrc": "import json\n",
    "pytest.ini": "[pytest]\naddopts = -p conftest\npythonpath = .\n",
    "tox.ini": "[pytest]\naddopts = -p conftest\n",
    "setup.cfg": "[tool:pytest]\naddopts = -p conftest\n",
    "pyproject.toml": '[tool.pytest.ini_options]\naddopts = "-p conftest"\npythonpath = ["."]\n',
    ".coveragerc": "[run]\nplugins = conftest\n",
    ".env": "PYTHONPATH=.\nMUTATOR_LIBRARY=/nowhere\n",
    ".netrc": "machine example.org login a password b\n",
    ".gitattributes": "* filter=run diff=run\n",
    ".mailmap": "Somebody Else <else@example.org> <you@example.org>\n",
    "pyvenv.cfg": "home = .\n",
    "run.pth": "import json\n",
    "dask.yml": "distributed: {preload: [conftest]}\n",
}
_HOOK = "open({mark!r}, 'a').write(__file__ + chr(10))\nraise SystemExit('ran ' + __file__)\n"


def plant_hooks(world: World) -> Path:
    """Put modules, rc files and a git folder everywhere; return the file that appears if one of them runs."""
    mark = world.mine / "ran"
    for place in (world.got, world.library, world.templates, world.tree, world.out):
        for name in MODULES:
            (place / f"{name}.py").write_text(_HOOK.format(mark=str(mark)))
        for name, text in _RC_FILES.items():
            (place / name).write_text(text)
        (place / ".git" / "hooks").mkdir(parents=True)
        run = f"touch {mark}"
        (place / ".git" / "HEAD").write_text("ref: refs/heads/main\n")
        (place / ".git" / "config").write_text(
            "[core]\n\trepositoryformatversion = 0\n"
            f'\tfsmonitor = "{run}"\n\tpager = "{run}"\n\tsshCommand = "{run}"\n'
            f'[filter "run"]\n\tclean = "{run}"\n\tsmudge = "{run}"\n[diff "run"]\n\ttextconv = "{run}"\n'
            f'[log]\n\tshowSignature = true\n[gpg]\n\tprogram = "{run}"\n[user]\n\tname = {SECRET}\n'
        )
        for name in ("objects", "refs"):
            (place / ".git" / name).mkdir()
    return mark
