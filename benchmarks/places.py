"""Count the places that produce a value, and those that anchors reach: `python benchmarks/places.py`.

The places are in eight modules of third-party packages, chosen before any count (`MODULES` says why), each in
the version of constraints.txt. They are counted with `ast` alone, not with the harness's own search. A place
can belong to several kinds: an argument that is a sum is an argument and arithmetic. Goal: 90 % of all.
"""

import argparse
import ast
import importlib.metadata
import importlib.util
import sys
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from mutator.errors import MutatorError
from mutator.faults.fault_models import FaultModels
from mutator.model import Anchor, AnchorKind, FaultLocation, Injection
from mutator.mutants.injection_edits import injection_edit
from mutator.mutants.parsed_files_and_anchors import ParsedFile, parse_file
from mutator.targets.source_tree import SourceTree, read_tree
from mutator.workspace import Workspace

MODULES = (  # module, distribution, why it was chosen
    ("highway_env.vehicle.controller", "highway-env", "a vehicle's controller"),
    ("can.bit_timing", "python-can", "timing of a bus: properties, checks, integer arithmetic"),
    ("cantools.database.utils", "cantools", "codecs of messages: bytes, formats, dictionaries"),
    ("scipy.optimize._zeros_py", "scipy", "numerical: iterations, tolerances, many defaults"),
    ("matplotlib.bezier", "matplotlib", "geometry on arrays"),
    ("networkx.algorithms.shortest_paths.weighted", "networkx", "algorithms: nested functions, heaps, loops"),
    ("jinja2.lexer", "jinja2", "text: regular expressions, tables, generators"),
    ("dateutil.relativedelta", "python-dateutil", "arithmetic of dates in one class, with operators"),
)
KINDS = (
    *("assignment", "item", "return", "condition", "comparison", "arithmetic", "argument", "literal"),
    *("constant", "default"),
)
GOAL = 0.9
_SCOPES = ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef | ast.Lambda
Spot = tuple[int, int, int, int]


@dataclass(frozen=True, slots=True, kw_only=True)
class Site:
    """A place that produces a value: its kind, its node, what encloses it, and the name that it binds."""

    kind: str
    node: ast.AST
    function: str  # "" at the level of a module or class
    name: str
    within: str  # why anchors cannot reach it: "f-string", "decorator", ...


class Counting(ast.NodeVisitor):
    def __init__(self) -> None:
        self.sites: list[Site] = []
        self.scope: list[str] = []
        self.functions = 0
        self.within: list[str] = []

    def add(self, kind: str, node: ast.AST | None, name: str = "") -> None:
        if node is not None:
            function = ".".join(self.scope) if self.functions else ""
            within = self.within[-1] if self.within else "" if function else "calculated at import"
            self.sites.append(Site(kind=kind, node=node, function=function, name=name, within=within))

    def inside(self, what: str, *nodes: ast.AST | None) -> None:
        self.within.append(what)
        for node in nodes:
            if node is not None:
                self.visit(node)
        self.within.pop()

    def visit_FunctionDef(self, node: ast.FunctionDef | ast.AsyncFunctionDef) -> None:
        for decorator in node.decorator_list:
            self.inside("decorator", decorator)
        self.defaults(node.args, ".".join((*self.scope, node.name)))
        self.scope.append(node.name)
        self.functions += 1
        for i, statement in enumerate(node.body):
            if not (i == 0 and ast.get_docstring(node, clean=False) is not None):
                self.visit(statement)
        self.functions -= 1
        self.scope.pop()

    visit_AsyncFunctionDef = visit_FunctionDef  # noqa: N815

    def visit_Lambda(self, node: ast.Lambda) -> None:
        self.defaults(node.args, "")
        self.visit(node.body)

    def defaults(self, args: ast.arguments, function: str) -> None:
        places = [*args.posonlyargs, *args.args]
        named = [*zip(places[len(places) - len(args.defaults) :], args.defaults, strict=True)]
        named += [(a, d) for a, d in zip(args.kwonlyargs, args.kw_defaults, strict=True) if d is not None]
        for argument, value in named:
            self.add("default", value, f"{function}:{argument.arg}" if not self.functions else "")

    def visit_ClassDef(self, node: ast.ClassDef) -> None:
        self.scope.append(node.name)
        outer, self.functions = self.functions, 0
        for statement in node.body:
            if not (isinstance(statement, ast.Expr) and isinstance(statement.value, ast.Constant)):
                self.visit(statement)
        self.functions = outer
        self.scope.pop()

    def visit_Assign(self, node: ast.Assign) -> None:
        for target in node.targets:
            self.bound(target, node.value)
        self.visit(node.value)

    def visit_AnnAssign(self, node: ast.AnnAssign) -> None:
        if node.value is not None:
            self.bound(node.target, node.value)
            self.visit(node.value)

    def visit_AugAssign(self, node: ast.AugAssign) -> None:
        self.bound(node.target, node.value)
        self.add("arithmetic", node, ast.unparse(node.target))
        self.visit(node.value)

    def visit_NamedExpr(self, node: ast.NamedExpr) -> None:
        self.bound(node.target, node.value)
        self.visit(node.value)

    def visit_For(self, node: ast.For) -> None:
        self.bound(node.target, None)
        self.generic_visit(node)

    def visit_With(self, node: ast.With) -> None:
        for item in node.items:
            if item.optional_vars is not None:
                self.bound(item.optional_vars, None)
        self.generic_visit(node)

    def bound(self, target: ast.expr, value: ast.expr | None) -> None:
        """Record each assigned name, attribute or item; at the level of a module or class, the constants."""
        if isinstance(target, ast.Tuple | ast.List):
            for element in target.elts:
                self.bound(element, None)
        elif isinstance(target, ast.Starred):
            self.bound(target.value, None)
        elif self.functions:
            kind = "item" if isinstance(target, ast.Subscript) else "assignment"
            self.add(kind, value or target, ast.unparse(target))
        elif isinstance(target, ast.Name):
            self.add("constant", target, ".".join((*self.scope, target.id)))
        else:
            self.add("item", target)

    def visit_Return(self, node: ast.Return) -> None:
        self.add("return", node.value)
        self.generic_visit(node)

    def tested(self, node: ast.If | ast.While | ast.IfExp | ast.Assert) -> None:
        self.add("condition", node.test)
        self.generic_visit(node)

    visit_If = visit_While = visit_IfExp = visit_Assert = tested  # noqa: N815

    def visit_comprehension(self, node: ast.comprehension) -> None:
        for test in node.ifs:
            self.add("condition", test)
        self.generic_visit(node)

    def visit_Compare(self, node: ast.Compare) -> None:
        self.add("comparison", node)
        self.generic_visit(node)

    def visit_BoolOp(self, node: ast.BoolOp) -> None:
        self.add("comparison", node)
        self.generic_visit(node)

    def visit_BinOp(self, node: ast.BinOp) -> None:
        self.add("arithmetic", node)
        self.generic_visit(node)

    def visit_UnaryOp(self, node: ast.UnaryOp) -> None:
        if isinstance(node.operand, ast.Constant):
            self.add("literal", node)
            return
        self.add("arithmetic", node)
        self.generic_visit(node)

    def visit_Subscript(self, node: ast.Subscript) -> None:
        if isinstance(node.ctx, ast.Load):
            self.add("item", node)
        self.generic_visit(node)

    def visit_Dict(self, node: ast.Dict) -> None:
        for key, value in zip(node.keys, node.values, strict=True):
            self.add("item", value if key is not None else None)
        self.generic_visit(node)

    def visit_Call(self, node: ast.Call) -> None:
        for argument in node.args:
            self.add("argument", argument)
        for keyword in node.keywords:
            self.add("argument", keyword.value)
        self.generic_visit(node)

    def visit_Constant(self, node: ast.Constant) -> None:
        self.add("literal", node)

    def visit_JoinedStr(self, node: ast.JoinedStr) -> None:
        for part in node.values:
            if isinstance(part, ast.FormattedValue):
                self.inside("f-string", part.value)

    def visit_arg(self, node: ast.arg) -> None:
        """Skip annotations, because they produce no value."""

    def visit_Expr(self, node: ast.Expr) -> None:
        if not isinstance(node.value, ast.Constant):
            self.generic_visit(node)


class Reach:
    """The places in a file that anchors reach."""

    def __init__(self, file: ParsedFile, models: FaultModels, tree: SourceTree) -> None:
        self.file, self.models, self.tree = file, models, tree
        known = [one for group in file.expressions_by_function.values() for one in group]
        self.spots = {(*one.start, *one.end) for one in known}

    def reaches(self, site: Site) -> bool:
        if site.kind in ("constant", "default") and not site.function:
            return self.sets(site)
        return _spot(site.node) in self.spots or (bool(site.name) and self.is_assigned(site))

    def sets(self, site: Site) -> bool:
        """Return whether the probe can set the constant or default."""
        function, _, name = site.name.rpartition(":")
        kind = AnchorKind.DEFAULT if site.kind == "default" else AnchorKind.CONSTANT
        location = FaultLocation(path=self.file.path, function=function, anchor=Anchor(kind=kind, name=name))
        injection = Injection(location=location, model="stuck", params=(("value", 1.0),))
        try:
            injection_edit(self.file, self.models, injection, "0a1b2c3d", self.tree)
        except MutatorError:
            return False
        return True

    def is_assigned(self, site: Site) -> bool:
        functions = self.file.functions_by_name.get(site.function, ())
        known = [
            s
            for f in functions
            for s in f.statements
            if s.unanchorable_reason is None and site.name in s.assigned_names
        ]
        for nth, statement in enumerate(known, 1):
            if (
                statement.first_line
                < _spot(site.node)[0] + 1
                <= max(statement.end_line, statement.first_line + 1)
            ):
                anchor = Anchor(kind=AnchorKind.AFTER_ASSIGN, name=site.name, nth=nth)
                location = FaultLocation(path=self.file.path, function=site.function, anchor=anchor)
                try:
                    self.file.resolve_statement(location)
                except MutatorError:
                    continue
                return True
        return False


def _spot(node: ast.AST) -> Spot:
    assert isinstance(node, ast.expr | ast.stmt)
    return node.lineno - 1, node.col_offset, (node.end_lineno or 0) - 1, node.end_col_offset or 0


def reason(site: Site) -> str:
    """Return why no anchor reaches a place."""
    if site.within:
        return site.within
    if isinstance(site.node, ast.Starred | ast.GeneratorExp | ast.Yield | ast.YieldFrom | ast.NamedExpr):
        return type(site.node).__name__
    if isinstance(site.node, ast.JoinedStr):
        return "an f-string as a whole"
    return "other"


def counted(name: str, models: FaultModels) -> Iterator[tuple[Site, bool]]:
    spec = importlib.util.find_spec(name)
    assert spec is not None and spec.origin is not None
    root, path = Path(spec.origin).parents[name.count(".")], f"{name.replace('.', '/')}.py"
    tree = read_tree(root, [f"{name.partition('.')[0]}/**/*.py"])
    file = parse_file(path, tree.files[path], root)
    counting, reach = Counting(), Reach(file, models, tree)
    counting.visit(ast.parse(file.data))
    for site in counting.sites:
        yield site, reach.reaches(site)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.partition(":")[0] + ".")
    parser.add_argument("--missed", action="store_true", help="list the places that no anchor reaches")
    options = parser.parse_args()
    models = Workspace.find(root=Path(__file__).resolve().parents[1]).fault_models()
    total, hit, why = Counter[str](), Counter[str](), Counter[str]()
    print(f"{'module':45} {'version':>8} {'sites':>6} {'reached':>8}")
    for name, distribution, _ in MODULES:
        found = list(counted(name, models))
        reached = sum(yes for _, yes in found)
        version = importlib.metadata.version(distribution)
        print(f"{name:45} {version:>8} {len(found):6} {reached / len(found):8.1%}")
        for site, yes in found:
            total[site.kind] += 1
            hit[site.kind] += yes
            if not yes:
                why[f"{site.kind}: {reason(site)}"] += 1
                if options.missed:
                    text = ast.unparse(site.node)[:70]
                    print(f"    {site.node.lineno:5} {site.kind:11} {reason(site):22} {text}")  # type: ignore[attr-defined]
    print(f"\n{'kind':12} {'sites':>6} {'reached':>8}")
    for kind in KINDS:
        print(f"{kind:12} {total[kind]:6} {hit[kind] / max(total[kind], 1):8.1%}")
    share = hit.total() / total.total()
    print(f"{'all':12} {total.total():6} {share:8.1%}   goal {GOAL:.0%}\n\nnot reached")
    for what, count in why.most_common():
        print(f"{count:6}  {what}")
    return 0 if share >= GOAL else 1


if __name__ == "__main__":
    sys.exit(main())
