"""`raymarch doctor`: shows which OpenGL backends work, and checks what the driver makes of shaders."""

from __future__ import annotations

import json as json_format
from dataclasses import asdict
from typing import Annotated, Any

import typer

from raymarch.cli.common import CommandError, Output
from raymarch.cli.progress import bar
from raymarch.gpu.doctor import examine


def run(
    json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
    check: Annotated[
        bool,
        typer.Option(
            "--check",
            help="Draw about 120 scenes of every shape, operators, effects and hard numbers on the first backend that "
            "works, and hold them against float64. Takes a minute or two; code 1 if one differs.",
        ),
    ] = False,
) -> None:
    found = examine()
    works = any(report.works for report in found)
    rows = _checked() if check and works else []
    if json:
        reports: Any = [report.to_dict() for report in found]
        said = {"backends": reports, "check": [_plain(row) for row in rows]} if check else reports
        typer.echo(json_format.dumps(said, indent=2))
    else:
        for report in found:
            _show_report(report)
        if rows:
            _show_check(rows)
    if not works:
        raise CommandError("no OpenGL context works here", legal="install one of the packages above")
    if not all(row.holds for row in rows):
        raise typer.Exit(1)


def _show_report(report: Any) -> None:
    out = Output()
    out.print(f"[bold]{report.backend}[/bold]  {'works' if report.works else 'does not work'}")
    rows: list[tuple[str, Any]] = []
    if report.works:
        limits = report.limits
        rows = [
            ("driver", f"{report.driver.renderer}, {report.driver.vendor}"),
            ("version", report.driver.version),
            ("runs on", "the CPU" if report.driver.is_software else "the GPU"),
            ("draws by", report.draws),
            ("largest picture", "{}x{}".format(*limits.picture)),
            ("texture size", limits.texture_size),
            ("uniform components", limits.fragment_uniform_components),
            ("loops", report.loops.words),
            ("clock", report.clock.verdict),
        ]
    else:
        rows = [("fault", report.error), ("cure", report.cure)]
    for name, value in rows:
        out.print(f"  {name:<20}{value}", markup=False)
    out.print()


def _checked() -> list[Any]:
    from raymarch.cost.device import SIZE, cases, check
    from raymarch.gpu.renderer import Renderer

    rows, all_cases = [], cases()
    with Renderer(SIZE) as renderer, bar("checking the driver", len(all_cases)) as report:
        for case in all_cases:
            rows.append(check(renderer, case))
            report(len(rows))
    return rows


def _plain(row: Any) -> dict[str, Any]:
    """A row as JSON types; nan is None."""
    return {name: None if value != value else value for name, value in asdict(row).items()} | {"holds": row.holds}


def _show_check(rows: list[Any]) -> None:
    from raymarch.cost.device import COLOR, DEPTH, NORMAL

    out = Output()
    heads = ("", "scenes", "hits", "missed", "invented", "depth, pixels", "normal, degrees", "color")
    line = "  {:<12}{:>8}{:>10}{:>8}{:>10}{:>15}{:>17}{:>10}"
    out.print("[bold]check against float64[/bold]  (99th percentiles; silhouettes left out)")
    out.print(line.format(*heads), markup=False)
    for group in dict.fromkeys(row.group for row in rows):
        some = [row for row in rows if row.group == group]
        worst = [
            f"{max((v for row in some if (v := getattr(row, name)) == v), default=float('nan')):.2g}"
            for name in ("depth", "normal", "color")
        ]
        counts = (sum(getattr(row, name) for row in some) for name in ("hits", "missed", "false"))
        out.print(line.format(group, len(some), *counts, *worst), markup=False)
    bad = [row for row in rows if not row.holds]
    for row in bad:
        what = row.fault or (
            f"{row.missed} missed, {row.false} invented, depth {row.depth:.2g} of {DEPTH} pixels, normal "
            f"{row.normal:.2g} of {NORMAL} degrees, color {row.color:.2g} of {COLOR}"
        )
        out.print(f"  {row.group}, {row.name}: {what}", markup=False)
    out.print(f"  {len(rows) - len(bad)} of {len(rows)} scenes are as in float64", markup=False)
    out.print()
