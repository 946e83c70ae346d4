"""`raymarch doctor`: shows which OpenGL backends work, and checks what the driver makes of shaders."""

from __future__ import annotations

import json as json_format
from dataclasses import asdict
from datetime import date
from typing import Annotated, Any

import typer

from raymarch.cli.common import CommandError, Output
from raymarch.cli.progress import bar
from raymarch.gpu.doctor import examine
from raymarch.gpu.measured_prices import summary
from raymarch.prices import NEVER, SWITCH


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
    measure: Annotated[
        bool,
        typer.Option(
            "--measure",
            help="Measure on the first backend that works what its driver takes for the parts of each choice, and plan "
            "by that from then on. Takes a minute or two.",
        ),
    ] = False,
) -> None:
    prices = _measured() if measure else None  # before other contexts, which would use the driver's cache of shaders
    found = examine()
    works = any(report.works for report in found)
    rows = _checked() if check and works else []
    if json:
        reports: Any = [{**report.to_dict(), "prices": _known(report)} for report in found]
        said = {"backends": reports}
        said |= {"check": [_plain(row) for row in rows]} if check else {}
        said |= {"prices": [asdict(each) for each in prices]} if prices is not None else {}
        said = said if check or measure else reports
        typer.echo(json_format.dumps(said, indent=2))
    else:
        for report in found:
            _show_report(report)
        if prices is not None:
            _show_prices(prices)
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
            ("prices", _prices_of(report)),
        ]
    else:
        rows = [("fault", report.error), ("cure", report.cure)]
    for name, value in rows:
        out.print(f"  {name:<20}{value}", markup=False)
    out.print()


def _known(report: Any) -> dict[str, Any] | None:
    """The measured prices of a backend's driver; None if there are none."""
    driver = report.driver
    return None if driver is None else summary(driver.renderer, driver.version, driver.class_alone)


def _prices_of(report: Any) -> str:
    """By which prices scenes are planned, and how to change it."""
    known = _known(report)
    if known is None:
        return (
            f"those of the class {report.driver.class_alone.name}; `raymarch doctor --measure` measures this driver's"
        )
    used = "used" if known["used"] else f"ignored, as {SWITCH} says"
    return f"measured on {known['date']}, {used}; remove '{known['file']}' to plan by the class alone"


def _measured() -> list[Any]:
    """Measure the prices of the first backend that works, and keep them."""
    from raymarch.cost.prices import Bench, measure
    from raymarch.gpu.context import open_context
    from raymarch.gpu.driver_cache import without_driver_cache
    from raymarch.gpu.measured_prices import check_folder, keep

    check_folder(CommandError)  # a minute before it is written
    with without_driver_cache(), open_context() as context, bar("measuring prices", 1.0) as report:
        made, found = measure(Bench(context, context.driver.class_alone), date.today().isoformat(), report)
    keep(made, CommandError)
    return found


def _show_prices(prices: list[Any]) -> None:
    from raymarch.cost.prices import MEANING

    out = Output()
    out.print("[bold]measured prices[/bold]")
    line = "  {:<16}{:>10}{:>22}{:>10}{:>10}  {}"
    out.print(line.format("", "measured", "interval", "class", "used", "unit"), markup=False)
    for each in prices:
        numbers = (_number(n) for n in (each.standard, each.standard if each.kept else each.value))
        interval = f"{_number(each.low)} to {_number(each.high)}"
        out.print(line.format(each.name, _number(each.value), interval, *numbers, MEANING[each.name]), markup=False)
    for each in prices:
        if each.kept:
            out.print(f"  {each.name}: that of the class is used, {each.kept}", markup=False)
    out.print("  All other prices are those of the class. An interval holds the median with a confidence of 95 %;")
    out.print("  of a wide one, the end that is nearest to the price of the class is used.")
    out.print()


def _number(price: float) -> str:
    return "never" if price == NEVER else f"{price:.3g}"


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
