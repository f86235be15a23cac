"""Create the edits of injections: resolve the anchor, render the snippet, check names."""

import ast
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from mutator.config.instance_conditions import names_in_condition
from mutator.config.location_syntax import base_variable, defence_at
from mutator.errors import MutatorError
from mutator.faults.fault_models import FaultModel, FaultModels, SnippetKind, TemplateNeed
from mutator.model import LOAD_TIME_ANCHORS, VALUE_ANCHORS, AnchorKind, Injection
from mutator.mutants.changeable_expressions import NO_TEMPLATE_PARTS, Expression, template_parts
from mutator.mutants.changed_file_reuse import reuse_key
from mutator.mutants.hidden_builtins import check_calls_builtins
from mutator.mutants.injected_line_syntax import (
    ORIGINAL_VALUE_NAME,
    activation_condition,
    active_check_source,
    constant_setting_line,
    default_setting_line,
    listening_check_source,
)
from mutator.mutants.modules_importing_constants import dotted_names_importing_constant
from mutator.mutants.name_scopes import bound_names, normalize_identifier, rescoped_names
from mutator.mutants.parsed_files_and_anchors import ParsedFile, ResolvedAnchor, parsed_file
from mutator.mutants.probe_contract import injection_id
from mutator.mutants.refused_places import check_place_can_be_hit
from mutator.mutants.splicing import (
    ExpressionEdit,
    LineEdit,
    apply_edits,
    constant_or_default_edit,
    expression_edit,
    guard_edit,
    insertion_edit,
    mutated_bytes,
)
from mutator.mutants.statement_template_texts import anchor_and_one_line_texts
from mutator.mutants.template_rendering import render_changed_value, render_snippet
from mutator.targets.allowed_locations import check_location_allowed
from mutator.targets.manifest import TargetManifest
from mutator.targets.source_tree import SourceTree


@dataclass(frozen=True, slots=True, kw_only=True)
class InjectionEdit:
    """What an injection changes in a file; `id` is in tags and in the probe's report."""

    id: str
    file: ParsedFile
    edit: LineEdit | ExpressionEdit


def edits_of(
    manifest: TargetManifest, models: FaultModels, injections: Sequence[Injection]
) -> list[InjectionEdit]:
    """Return the edits of a fault's injections, in order. Only here does a fault's value enter a mutant. An
    injection into a defence that the tree does not have has none.

    MutatorError as `injection_edit`, and for a location outside the target or where no fault can act.
    """
    edits = []
    for index, injection in enumerate(injections):
        if not is_in_tree(injection, manifest.tree):
            continue
        check_location_allowed(manifest, injection.location)
        check_place_can_be_hit(manifest, injection.location)
        name, file = injection_id(index, injection), parsed_file(manifest.tree, injection.location.path)
        edit = injection_edit(file, models, injection, name, manifest.tree)
        edits.append(InjectionEdit(id=name, file=file, edit=edit))
    return edits


def is_in_tree(injection: Injection, tree: SourceTree) -> bool:
    """Return whether a tree has the defence that an injection changes. True for a place in the target."""
    return not defence_at(injection.location.path) or injection.location.path in tree.files


def injection_edit(
    file: ParsedFile,
    models: FaultModels,
    injection: Injection,
    tag: str,
    tree: SourceTree | None = None,
) -> LineEdit | ExpressionEdit:
    """Return the edit of one injection in its file, tagged with `tag`.

    `tree` has the files that might import a constant. MutatorError for a missing anchor, a name unknown in
    the function, and lines that would change what the target's names mean while the fault is inactive, or
    that would call a function of the target instead of a built-in one.
    """
    model = models.get(injection.model)
    if injection.location.anchor.kind in VALUE_ANCHORS:
        return _expression_edit(file, model, injection, tag)
    if injection.location.anchor.kind in LOAD_TIME_ANCHORS:
        return _constant_or_default_edit(file, model, injection, tag, tree)
    anchor = file.resolve_statement(injection.location)
    variables = _checked_variable_params(
        file, anchor.names_used_in_function, anchor.first_line, model, injection
    )
    texts: dict[str, str] = {}
    if model.needs is TemplateNeed.CALL:
        raise _model_misfit_error(file, model, anchor.first_line)
    if model.needs is not None:
        anchor, texts = anchor_and_one_line_texts(file, anchor, model.needs)
    _check_instance_condition(file, anchor.names_used_in_function, anchor.first_line, injection)
    code = _snippet_limited_to_instances(
        render_snippet(model, dict(injection.params), tag, texts), injection, tag, model
    )
    make_edit = guard_edit if model.kind is SnippetKind.GUARD else insertion_edit
    edit = make_edit(file, anchor, code, tag)
    key = (variables, reuse_key(file, [edit], [tag]))
    if key not in file.verified_edits:
        guarded = [*code, "    pass"] if model.kind is SnippetKind.GUARD else code
        check_calls_builtins(file, anchor.first_line, model, "\n".join(guarded))
        _check_rebinds_no_used_name(
            file, anchor, model, guarded, variables.union(*map(_names_bound_by, texts.values()))
        )
        _check_keeps_name_scopes(file, anchor, edit)
        file.verified_edits.add(key)
    return edit


def _expression_edit(file: ParsedFile, model: FaultModel, injection: Injection, tag: str) -> ExpressionEdit:
    expression = file.resolve_expression(injection.location)
    params, parts = dict(injection.params), template_parts(expression)
    if model.needs is TemplateNeed.CALL and not parts["called"]:
        raise _model_misfit_error(file, model, expression.start[0])
    changed = render_changed_value(model, params, tag, expression.one_line_source, parts)
    names = file.names_used_in_function_at(injection.location)
    _checked_variable_params(file, names, expression.start[0], model, injection)
    _check_instance_condition(file, names, expression.start[0], injection)
    _check_binds_no_new_name(file, model, expression, changed)
    check_calls_builtins(file, expression.start[0], model, changed)
    return expression_edit(file, expression, changed, tag, activation_condition(tag, injection))


def _check_binds_no_new_name(
    file: ParsedFile, model: FaultModel, expression: Expression, changed: str
) -> None:
    new_names = (
        _names_bound_by_walrus(ast.parse(changed, mode="eval")) - _names_bound_by_walrus(expression.node)
        if ":=" in changed
        else ()
    )
    if new_names:
        raise MutatorError(
            f"the template sets '{min(new_names)}': {changed}",
            where=file.full_path,
            line=expression.start[0] + 1,
            expected="an expression that sets no name",
            remedy=f"correct {model.template_path.name}",
        )


def _names_bound_by_walrus(node: ast.AST) -> set[str]:
    return {part.target.id for part in ast.walk(node) if isinstance(part, ast.NamedExpr)}


def _model_misfit_error(file: ParsedFile, model: FaultModel, line: int) -> MutatorError:
    expected_by_need = {
        None: f"an expression with these parts: {', '.join(sorted(model.expression_parts))}",
        TemplateNeed.CALL: "a call: an anchor `result`, or another anchor whose expression is a call",
        TemplateNeed.STATEMENT: "a statement, or an expression in a function",
        TemplateNeed.NEXT_STATEMENT: "a statement, and another one after it",
    }
    return MutatorError(
        f"model {model.name} does not fit this anchor",
        where=file.full_path,
        line=line + 1,
        expected=expected_by_need[model.needs],
        remedy="anchor elsewhere, or use another model",
    )


def _constant_or_default_edit(
    file: ParsedFile, model: FaultModel, injection: Injection, tag: str, tree: SourceTree | None
) -> LineEdit:
    value, params = file.resolve_constant_or_default(injection.location), dict(injection.params)
    if model.needs is TemplateNeed.CALL or model.expression_parts:
        raise _model_misfit_error(file, model, value.first_line)
    for param in model.params:
        if param.type == "variable" and params.get(param.name) is not None:
            raise MutatorError(
                f"`{param.name}` is '{params[param.name]}', but the anchor is a {value.kind.value}",
                where=file.full_path,
                line=value.first_line + 1,
                expected="no variable, because a constant or default is set outside functions",
                remedy=f"leave `{param.name}` out, or anchor in a function",
            )
    changed = render_changed_value(model, params, tag, ORIGINAL_VALUE_NAME, NO_TEMPLATE_PARTS)
    if value.kind is AnchorKind.CONSTANT:
        of_module = "." not in value.name
        imported = dotted_names_importing_constant(tree, file.path, value.name) if tree and of_module else ()
        code = constant_setting_line(tag, value.dotted_path, changed, imported)
    else:
        function, _, parameter = value.dotted_path.rpartition(".")
        code = default_setting_line(tag, function, parameter, changed)
    check_calls_builtins(file, value.first_line, model, code)
    return constant_or_default_edit(file, value, code, tag)


def _checked_variable_params(
    file: ParsedFile, names: frozenset[str], first_line: int, model: FaultModel, injection: Injection
) -> frozenset[str]:
    params = dict(injection.params)
    variables = set()
    for param in model.params:
        value = params.get(param.name)
        if param.type == "variable" and isinstance(value, str):
            variable = normalize_identifier(base_variable(value))
            if variable not in names:
                raise MutatorError(
                    f"'{value}' is not known in {injection.location.function}",
                    where=file.full_path,
                    line=first_line + 1,
                    expected=f"a name used there: {', '.join(sorted(names))}",
                    remedy=f"correct `{param.name}`",
                )
            variables.add(variable)
    return frozenset(variables)


def _check_instance_condition(
    file: ParsedFile, names: frozenset[str], first_line: int, injection: Injection
) -> None:
    unknown = names_in_condition(injection.where or "True") - names
    if unknown:
        raise MutatorError(
            f"'{min(unknown)}' in `where` is not known in {injection.location.function}",
            where=file.full_path,
            line=first_line + 1,
            expected=f"names used there: {', '.join(sorted(names))}",
            remedy="correct `where`",
        )


def _snippet_limited_to_instances(
    code: tuple[str, ...], injection: Injection, tag: str, model: FaultModel
) -> tuple[str, ...]:
    """Add to the snippet a check for the instance or executions that the injection selects, if any."""
    check, listening = active_check_source(tag), listening_check_source(tag)
    if any(listening in line for line in code):
        check = listening
    condition = activation_condition(tag, injection, check)
    if condition == check:
        return code
    limited_lines = {f"if {check}:": f"if {condition}:", f"if not {check}:": f"if not ({condition}):"}
    if sum(line.count(check) for line in code) != 1 or not any(line in limited_lines for line in code):
        raise MutatorError(
            f"model {model.name}, with these parameters, cannot be limited by `where`, `call` or `every`",
            where=model.template_path,
            expected=f"a template with exactly one probe check, `if {check}:` or `if not {check}:`",
            remedy="remove `where`, `call` and `every`, or use another model",
        )
    return tuple(limited_lines.get(line, line) for line in code)


def _check_rebinds_no_used_name(
    file: ParsedFile,
    anchor: ResolvedAnchor,
    model: FaultModel,
    code: Sequence[str],
    variables: frozenset[str],
) -> None:
    clashes = (
        {normalize_identifier(name) for name in _names_bound_by("\n".join(code))} - variables
    ) & anchor.names_used_in_function
    if clashes:
        raise MutatorError(
            f"the injected lines set '{min(clashes)}', a name that the function uses itself",
            where=file.full_path,
            line=anchor.first_line + 1,
            expected="lines that set only parameters and names that the function does not use",
            remedy=f"rename it in {model.template_path.name}, or make it a parameter",
        )


def _names_bound_by(code: str) -> Iterator[str]:
    return bound_names(ast.parse(code))


def _check_keeps_name_scopes(file: ParsedFile, anchor: ResolvedAnchor, edit: LineEdit) -> None:
    inserted = range(edit.line_index + 1, edit.line_index + 1 + len(edit.lines))
    try:
        moved = next(rescoped_names(file.data, mutated_bytes(apply_edits(file, [edit])), inserted), None)
    except SyntaxError:
        return  # the mutant does not compile, which building reports
    if moved:
        raise MutatorError(
            f"the lines would make '{moved.name}' {moved.scope_after} in {moved.function_or_class}, "
            f"where it is {moved.scope_before}",
            where=file.full_path,
            line=anchor.first_line + 1,
            expected="a variable that the function sets itself, or declares `global` or `nonlocal`",
            remedy="inject where the variable is set, or into another variable that is computed from it",
        )
