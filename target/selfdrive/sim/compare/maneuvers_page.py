"""The page of maneuvers: each run's key figures and plots, with the reference if there is one."""

from dataclasses import dataclass
from html import escape

import numpy as np

from selfdrive.sim.compare import key_figures
from selfdrive.sim.compare.finished_runs import FinishedRun
from selfdrive.sim.compare.svg_plots import PlotLine, PlotMark, PlotPanel, draw_panel
from selfdrive.sim.compare.trace_comparison import TraceComparison
from selfdrive.sim.compare.trace_csv import (
    STEPS_PER_ROW,
    STEPS_PER_SECOND,
    ReferenceTrace,
    comparable_channels,
)

_PAGE_CSS = """
:root{color-scheme:light dark;--back:#fff;--ink:#1d2330;--dim:#5d6675;--grid:#e4e7ec;--zero:#a8b0bd;
--c0:#1667c7;--c1:#c4500a;--c2:#2c8a3d;--alert:#a66a00;--hazard:#c8102e;--bad:#c8102e;--good:#24803a}
@media(prefers-color-scheme:dark){:root{--back:#14171d;--ink:#e4e8ef;--dim:#9aa4b4;--grid:#2b313b;
--zero:#5b6573;--c0:#69aef8;--c1:#f79a57;--c2:#71cf82;--alert:#f0b64a;--hazard:#ff6b7d;--bad:#ff6b7d;--good:#71cf82}}
body{margin:0 auto;max-width:1700px;padding:1rem 1.2rem 3rem;background:var(--back);color:var(--ink);
font:15px/1.45 system-ui,sans-serif}
h1{font-size:1.5rem;margin:.4rem 0}h2{font-size:1.15rem;margin:2.2rem 0 .3rem}
p{margin:.3rem 0;color:var(--dim)}
h3{font-size:.9rem;margin:.5rem 0 0;font-weight:600}a{color:var(--c0)}
.scroll{overflow-x:auto}table{border-collapse:collapse;margin:.5rem 0;font-size:.82rem;
font-variant-numeric:tabular-nums}
th,td{text-align:right;padding:.12rem .5rem;border-bottom:1px solid var(--grid);white-space:nowrap}
th{font-weight:600;color:var(--dim)}td.t,th.t{text-align:left}
.plots{display:grid;grid-template-columns:repeat(auto-fit,minmax(min(330px,100%),1fr));gap:.2rem 1rem}
.key{font-size:.8rem;color:var(--dim)}.key i{display:inline-block;width:1.3em;height:.22em;
vertical-align:.25em;margin:0 .3em 0 .8em}
.k0{background:var(--c0)}.k1{background:var(--c1)}.k2{background:var(--c2)}
svg{width:100%;height:auto;display:block}path{fill:none;stroke-linejoin:round}
.g{stroke:var(--grid);stroke-width:8}.z{stroke:var(--zero);stroke-width:10}
.c0,.c1,.c2{stroke-width:16}.c0{stroke:var(--c0)}.c1{stroke:var(--c1)}.c2{stroke:var(--c2)}
.r{stroke-width:60;opacity:.33;stroke-linecap:round}
text{font-size:105px;fill:var(--dim)}.e{text-anchor:end}.m{text-anchor:middle}
path.engaged{stroke:var(--zero);stroke-width:10;stroke-dasharray:40 30}
path.alert{stroke:var(--alert);stroke-width:14}text.alert{fill:var(--alert)}
path.hazard{stroke:var(--hazard);stroke-width:18}text.hazard{fill:var(--hazard)}
.bad,span.hazard{color:var(--bad)}span.alert{color:var(--alert)}.good{color:var(--good)}
"""

# For each panel: title, unit, and lines of (label, channel).
_PANEL_CHANNELS = (
    ("Distance", "m", (("to the lead", "d_rel"),)),
    ("Speed", "m/s", (("host", "v_ego"), ("lead", "v_lead"), ("set", "v_cruise"))),
    ("Acceleration", "m/s²", (("host", "a_ego"), ("planned", "a_target"))),
    ("Pedals", "share", (("gas", "gas"), ("brake", "brake"))),
    ("Lead as estimated", "m/s, m/s²", (("speed", "lead_v_lead_k"), ("acceleration", "lead_a_lead_k"))),
)
_FIGURE_TITLES = {
    "engaged_s": "engaged [s]",
    "set_speeds_kph": "set speeds [km/h]",
    "min_hwt_s": "smallest HWT [s]",
    "min_d_rel_m": "smallest d_rel [m]",
    "max_brake": "strongest braking",
}
_LEAD_ESTIMATE_CHANNELS = ("lead_v_lead_k", "lead_a_lead_k")


@dataclass(frozen=True, slots=True, kw_only=True)
class ManeuverResult:
    run: FinishedRun
    reference: ReferenceTrace | None
    comparison: TraceComparison | None


def render_maneuvers_page(maneuvers: list[ManeuverResult], plant: str) -> str:
    rows = "".join(_overview_row(maneuver) for maneuver in maneuvers)
    sections = "".join(_maneuver_section(maneuver) for maneuver in maneuvers)
    head = "".join(f"<th>{_FIGURE_TITLES[name]}</th>" for name in key_figures.FIGURE_MEANINGS)
    return (
        '<!doctype html><html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width,initial-scale=1">'
        f"<title>Maneuvers</title><style>{_PAGE_CSS}</style></head><body><h1>Maneuvers</h1>"
        f"<p>Fault-free runs on the {escape(plant)} plant: {len(maneuvers)}. Thin lines are the runs, broad "
        "pale lines beneath them the references; time in seconds. Dashed: engaging.</p>"
        f'<div class="scroll"><table><tr><th class="t">run</th><th class="t">what happens</th>'
        f'<th class="t">reference</th><th class="t">hazards and alerts</th>{head}</tr>'
        f"{rows}</table></div>{sections}</body></html>\n"
    )


def _overview_row(maneuver: ManeuverResult) -> str:
    name = escape(maneuver.run.name)
    cells = "".join(
        f"<td>{key_figures.figure_text(key, value)}</td>"
        for key, value in _key_figures_of_run(maneuver.run).items()
    )
    verdict, kind = "-", ""
    if maneuver.comparison:
        verdict, kind = (
            ("within tolerance", "good")
            if maneuver.comparison.is_within_tolerance
            else ("beyond tolerance", "bad")
        )
    return (
        f'<tr><td class="t"><a href="#{name}">{name}</a></td><td class="t">{escape(maneuver.run.title)}</td>'
        f'<td class="t {kind}">{verdict}</td><td class="t">{_events_text(maneuver.run)}</td>{cells}</tr>'
    )


def _maneuver_section(maneuver: ManeuverResult) -> str:
    run = maneuver.run
    end = len(run.trace["t"]) / STEPS_PER_SECOND
    plots = "".join(
        f"<div><h3>{panel.title} [{panel.unit}]</h3>{_plot_legend(panel)}"
        f"{draw_panel(panel, _event_marks(run), end)}</div>"
        for panel in _plot_panels(maneuver)
    )
    return (
        f'<section id="{escape(run.name)}"><h2>{escape(run.name)}: {escape(run.title)}</h2>'
        f"<p>{_events_text(run) or 'no hazard, no alert'}</p>{_comparison_table(maneuver.comparison)}"
        f'<div class="plots">{plots}</div></section>'
    )


def _comparison_table(comparison: TraceComparison | None) -> str:
    if comparison is None:
        return ""
    rows = [
        (
            _FIGURE_TITLES[figure.name],
            key_figures.figure_text(figure.name, figure.run_value),
            key_figures.figure_text(figure.name, figure.reference_value),
            figure.limit,
            figure.is_beyond_limit,
        )
        for figure in comparison.figure_comparisons
    ]
    rows += [
        (
            f"{channel.column.channel} rms [{channel.column.unit}]",
            f"{channel.rms:.4f}",
            "-",
            channel.limits.rms,
            bad,
        )
        for channel in comparison.channel_comparisons
        if channel.limits.rms is not None
        for bad in ("rms" in channel.exceeded_limits,)
    ]
    head = "".join(f"<th>{name}</th>" for name, *_ in rows)
    run_cells = "".join(
        f'<td class="{"bad" if failed else ""}">{value}</td>' for _, value, _, _, failed in rows
    )
    reference_cells = "".join(f"<td>{value}</td>" for _, _, value, _, _ in rows)
    limit_cells = "".join(f"<td>{'-' if limit is None else f'{limit:g}'}</td>" for *_, limit, _ in rows)
    return (
        f'<div class="scroll"><table><tr><th></th>{head}</tr><tr><td class="t">run</td>{run_cells}</tr>'
        f'<tr><td class="t">reference</td>{reference_cells}</tr>'
        f'<tr><td class="t">tolerance</td>{limit_cells}</tr>'
        "</table></div>"
    )


def _plot_panels(maneuver: ManeuverResult) -> list[PlotPanel]:
    run_channels = comparable_channels(maneuver.run.trace)
    plotted_steps = np.arange(0, len(run_channels["t"]), STEPS_PER_ROW)
    panels = []
    for title, unit, labelled_channels in _PANEL_CHANNELS:
        lines = []
        for colour, (label, channel) in enumerate(labelled_channels):
            if maneuver.run.free_road and channel == "v_lead":
                continue
            lines.append(
                PlotLine(
                    label,
                    colour,
                    run_channels["t"][plotted_steps],
                    _values_to_plot(run_channels, channel)[plotted_steps],
                )
            )
            if maneuver.reference and channel in maneuver.reference.channels:
                seconds = maneuver.reference.steps / STEPS_PER_SECOND
                reference_values = _values_to_plot(maneuver.reference.channels, channel)
                lines.append(PlotLine(label, colour, seconds, reference_values, is_reference=True))
        panels.append(PlotPanel(title=title, unit=unit, lines=tuple(lines)))
    return panels


def _values_to_plot(channels: dict[str, np.ndarray], channel: str) -> np.ndarray:
    values, condition = channels[channel], None
    if channel == "v_cruise":
        condition = channels.get("engaged")
    elif channel in _LEAD_ESTIMATE_CHANNELS:
        condition = channels.get("lead_status")
    return values if condition is None else np.where(condition == 1.0, values, np.nan)


def _plot_legend(panel: PlotPanel) -> str:
    names = {line.colour_number: line.label for line in panel.lines}
    keys = "".join(f'<i class="k{colour}"></i>{escape(label)}' for colour, label in sorted(names.items()))
    return f'<div class="key">{keys}</div>'


def _key_figures_of_run(run: FinishedRun) -> dict[str, key_figures.FigureValue]:
    channels = comparable_channels(run.trace)
    return key_figures.compute_key_figures(np.arange(len(channels["t"])), channels)


def _event_marks(run: FinishedRun) -> tuple[PlotMark, ...]:
    hazards = (PlotMark("hazard", name, t) for name, t in run.record["hazards"].items() if t is not None)
    alerts = (PlotMark("alert", event["name"], event["t"]) for event in run.record["alert_events"])
    engaged = run.record["engaged_from"]
    start = () if engaged is None else (PlotMark("engaged", "", engaged),)
    return (*start, *sorted((*hazards, *alerts), key=lambda mark: mark.t))


def _events_text(run: FinishedRun) -> str:
    return ", ".join(
        f'<span class="{mark.kind}">{escape(mark.label)} at {mark.t:.2f} s</span>'
        for mark in _event_marks(run)
        if mark.label
    )
