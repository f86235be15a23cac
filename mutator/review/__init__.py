"""Review of generated diffs: groups of mutants, decisions, the review page, `--require-reviewed`. This
package runs no experiments.
"""
