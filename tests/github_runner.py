"""Runs the steps of action.yml that have a script, as a runner of GitHub does."""

import os
import re
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import yaml

CLONE = Path(__file__).parents[1]
ACTION: dict[str, Any] = yaml.safe_load((CLONE / "action.yml").read_text())
STEPS: list[dict[str, Any]] = ACTION["runs"]["steps"]
EXPRESSION = re.compile(r"\$\{\{ (.*?) \}\}")
# stands for Python, whose pip would need the network
FAKE_PYTHON = """\
#!/bin/sh
if [ "$1 $2 $3" != "-P -m venv" ]; then exec "{python}" "$@"; fi
mkdir -p "$4/bin"
printf '#!/bin/sh\\necho "$@" >>"$0.log"\\n' >"$4/bin/pip"
printf '#!/bin/sh\\nPYTHONPATH="{clone}" exec "{python}" "$@"\\n' >"$4/bin/python"
printf '#!/bin/sh\\nPYTHONPATH="{clone}" exec "{python}" -m mutator "$@"\\n' >"$4/bin/mutator"
chmod +x "$4"/bin/*
"""


@dataclass
class Runner:
    """Runs the steps of the action that have a script, in the environment that a runner gives them."""

    temp: Path
    workspace: Path
    context: dict[str, str]
    environment: dict[str, str] = field(default_factory=dict)
    log: str = ""
    skipped: list[str] = field(default_factory=list)

    def run(self, inputs: Mapping[str, str]) -> int:
        """Run all steps as for a job without cached files; return the exit code of the first that failed."""
        for name, declared in ACTION["inputs"].items():
            self.context[f"inputs.{name}"] = inputs.get(name, declared.get("default", ""))
        code = 0
        for step in STEPS:
            if "run" not in step:
                continue
            if not self.should_run(step.get("if", "success()"), code):
                self.skipped.append(step["name"])
                continue
            failed = self.run_step(step)
            if "id" in step:
                self.context[f"steps.{step['id']}.outcome"] = "failure" if failed else "success"
            code = code or failed
        return code

    def should_run(self, condition: str, code: int) -> bool:
        parts = condition.split(" && ")
        if "always()" not in parts and code:
            return False
        for part in parts:
            if part not in ("always()", "success()"):
                left, sign, right = part.split(" ")
                if (self.context.get(left, "") == right.strip("'")) != (sign == "=="):
                    return False
        return True

    def run_step(self, step: Mapping[str, Any]) -> int:
        files = {}
        for name in ("OUTPUT", "ENV", "PATH"):
            files[name] = self.temp / f"{name}.txt"
            files[name].write_text("")
        script = self.temp / "script.sh"
        script.write_text(step["run"])
        given = {name: self.evaluated(value) for name, value in step.get("env", {}).items()}
        done = subprocess.run(
            ["bash", "--noprofile", "--norc", "-eo", "pipefail", str(script)],
            cwd=self.workspace,
            env=self.environment | given | {f"GITHUB_{name}": str(path) for name, path in files.items()},
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            check=False,
        )
        self.log += done.stdout
        for line in files["OUTPUT"].read_text().splitlines():
            name, _, value = line.partition("=")
            self.context[f"steps.{step['id']}.outputs.{name}"] = value
        self.environment |= dict(line.split("=", 1) for line in files["ENV"].read_text().splitlines())
        paths = files["PATH"].read_text().split()
        self.environment["PATH"] = os.pathsep.join([*paths, self.environment["PATH"]])
        return done.returncode

    def evaluated(self, text: str) -> str:
        def value(match: re.Match[str]) -> str:
            return next(filter(None, (self.context.get(name, "") for name in match[1].split(" || "))), "")

        return EXPRESSION.sub(value, text)

    def annotations(self, kind: str) -> list[str]:
        return [line for line in self.log.splitlines() if line.startswith(f"::{kind}")]


def git(folder: Path, *words: str) -> str:
    identity = ("-c", "user.name=a", "-c", "user.email=a@b.c", "-c", "init.defaultBranch=main")
    done = subprocess.run(["git", *identity, *words], cwd=folder, capture_output=True, text=True, check=True)
    return done.stdout.strip()


def build_runner(repository: Path, place: Path) -> Runner:
    """Return a runner for a pull request to `main`, with its files in the folder `place`."""
    temp = place / "temp"
    (temp / "bin").mkdir(parents=True)
    python = temp / "bin" / "python"
    python.write_text(FAKE_PYTHON.format(python=sys.executable, clone=CLONE))
    python.chmod(0o755)
    environment = {
        "PATH": os.pathsep.join([str(temp / "bin"), os.environ["PATH"]]),
        "HOME": str(place / "home"),
        "CI": "true",
        "GITHUB_ACTIONS": "true",
        "GITHUB_WORKSPACE": str(repository),
        "GITHUB_STEP_SUMMARY": str(temp / "summary.md"),
        "RUNNER_TEMP": str(temp),
        "RUNNER_OS": "Linux",
    }
    context = {
        "github.action_path": str(CLONE),
        "github.base_ref": "main",
        "runner.temp": str(temp),
        "steps.python.outputs.python-version": "3.12.1",
    }
    return Runner(temp=temp, workspace=repository, context=context, environment=environment)
