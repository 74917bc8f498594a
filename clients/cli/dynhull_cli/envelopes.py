"""`dynhull phases` and `dynhull frontier`: a hull as a phase diagram or as an efficient frontier."""

import math
from itertools import zip_longest
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from dynhull_client import HullClient

from .connected import AsJson, connected
from .json_lines import json_line
from .listing import listed
from .tab_lines import tab_line


@connected
def phases(
    client: "HullClient",
    name: Annotated[
        str, typer.Argument(metavar="HULL", help="A hull of entries: composition from 0 to 1, and energy.")
    ],
    entries: Annotated[
        list[str] | None,
        typer.Argument(metavar="COMPOSITION,ENERGY", help="Entries to look up; - for lines of standard input."),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Read a hull as a phase diagram: the stable entries, or what other entries decompose into.

        dynhull phases iron-aluminium 0.25,-0.1 0.6,-0.2

    Without entries: one line per stable entry, from left to right. With entries: one line each, with the entry, its
    energy above the hull, the stable entries to its left and right, and the share of each; nan beyond the outermost.
    """
    from .rows import number_rows

    if not entries:
        for entry in listed(client.phase_diagram(name).stable.tolist(), f"{name} has no stable entries"):
            typer.echo(json_line(stable=entry) if as_json else tab_line(entry))
        return
    for rows in number_rows(entries):
        found = client.phase_diagram(name, rows)
        for entry, above, both, shares in zip(rows, found.energies_above_hull, found.phases, found.shares, strict=True):
            if as_json:
                typer.echo(json_line(asked=entry, energy_above_hull=above, phases=both, shares=shares))
            else:
                typer.echo(tab_line(entry, above, both, shares))


@connected
def frontier(
    client: "HullClient",
    name: Annotated[str, typer.Argument(metavar="HULL", help="A hull of points: risk, which is positive, and return.")],
    points: Annotated[
        list[str] | None,
        typer.Argument(metavar="RISK,RETURN", help="Points to look up; - for lines of standard input."),
    ] = None,
    rates: Annotated[
        list[float] | None, typer.Option("--rate", help="A risk-free rate, to find the best point for. Repeatable.")
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Read a hull as an efficient frontier: its corners, which points it dominates, the best ones for risk-free rates.

        dynhull frontier shares 0.2,0.05 0.3,0.12 --rate 0.01

    Without points and rates: one line per corner, from least risk to most return, with the corner and the rate at which
    the next one becomes the best. With points: one line each, with the point and whether the frontier dominates it.
    With rates: one line each, with the rate, the best point (the tangency: the most excess return per risk), and that
    ratio (Sharpe's).
    """
    from .rows import number_rows

    if not points and not rates:
        found = client.frontier(name)
        corners = zip_longest(found.efficient, found.turning_rates, fillvalue=math.nan)
        for corner, rate in listed(corners, f"{name} has no efficient points"):
            typer.echo(json_line(efficient=corner, turning_rate=rate) if as_json else tab_line(corner, rate))
    for rows in number_rows(points) if points else ():
        for point, dominated in zip(rows, client.frontier(name, rows).dominated.tolist(), strict=True):
            if as_json:
                typer.echo(json_line(asked=point, dominated=dominated))
            else:
                typer.echo(tab_line(point, "dominated" if dominated else "not dominated"))
    if rates:
        best = client.frontier(name, rates=rates)
        for rate, point, ratio in zip(rates, best.tangencies, best.sharpe_ratios, strict=True):
            if as_json:
                typer.echo(json_line(rate=rate, tangency=point, sharpe_ratio=ratio))
            else:
                typer.echo(tab_line(rate, point, ratio))
