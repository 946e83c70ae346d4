"""`raymarch doctor`: shows which OpenGL backends work."""

from __future__ import annotations

import json as json_format
from typing import Annotated, Any

import typer

from raymarch.cli.common import CommandError, Output
from raymarch.gpu.doctor import examine


def run(json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False) -> None:
    reports = examine()
    if json:
        typer.echo(json_format.dumps([report.to_dict() for report in reports], indent=2))
    else:
        for report in reports:
            _show_report(report)
    if not any(report.works for report in reports):
        raise CommandError("no OpenGL context works here", legal="install one of the packages above")


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
