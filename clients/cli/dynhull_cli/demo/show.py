"""Shows a replay: its milestones, its largest hull and whether every step agreed."""

from importlib.util import find_spec
from pathlib import Path

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from dynhull_client import FenceEvent, HullClient

from .again import play_again
from .replay import ReplayStep, replay
from .scene import Scene
from .server import server_process

MOST_CORNERS = 12  # named in a line


def show(console: Console, scene: Scene, out: Path) -> bool:
    """Replay a scene, print its milestones and draw the picture; returns whether every step agreed."""
    past = find_spec("pyarrow") is not None
    if find_spec("matplotlib") is None:  # say so before the replay, not when the picture is to be drawn
        raise ModuleNotFoundError(name="matplotlib")
    console.print(f"[bold]{scene.title}[/bold]")
    for note in scene.notes:
        console.print(note, markup=False)
    steps: list[ReplayStep] = []
    again = 0
    alarms = 0, 0
    events: list[FenceEvent] = []
    largest: ReplayStep | None = None
    difference = None
    columns = [BarColumn(), MofNCompleteColumn(), TextColumn(scene.step), TimeRemainingColumn()]
    with (
        server_process() as address,
        HullClient(address) as client,
        Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as progress,
    ):
        for step in progress.track(replay(client, scene, history=past), total=scene.length):
            alarms = step.alarms
            events += step.events
            if step.difference:
                difference = f"{step.frame.clock}: {step.difference}"
                break
            steps.append(step)
            if largest is None or step.area > largest.area:
                largest = step
            if step.frame.milestone:
                console.print(_line(scene, step), markup=False)
                for line in _event_lines(events):
                    console.print(line, markup=False)
                events.clear()
        if past and difference is None:
            played = play_again(client, scene, steps)
            for step, different in zip(steps, progress.track(played, total=len(steps)), strict=True):
                if different:
                    difference = f"{step.frame.clock}, played again: {different}"
                    break
                again += 1
    if largest and len(largest.vertices):
        from .picture import draw  # matplotlib takes a while to load, and only the end needs it

        draw(out, scene, largest)
        console.print(f"Largest at {largest.frame.clock}: {largest.area:,.0f} {scene.area_unit}. Picture: {out}")
    _print_compared(console, scene, len(steps), alarms, again if past else None)
    if difference:
        console.print(f"[red]DIFFERENT[/red] at {difference}")
        return False
    console.print(f"[green]VERIFIED {len(steps)}/{scene.length}[/green]")
    return True


def _print_compared(console: Console, scene: Scene, steps: int, alarms: tuple[int, int], again: int | None) -> None:
    """Say what was compared; `again` is the number of steps that agree with the past, None if it was not kept."""
    sent = "keys and positions" if scene.keyed else "points"
    console.print(
        "Compared after each batch: the live hull with Chan's recomputation, its "
        f"{sent} with those sent, the watcher's copy with the live hull: {steps} {scene.step}"
    )
    if scene.circles or scene.rivals:
        agreed, expected = alarms
        console.print(
            "Compared with a recomputation from all positions: every enter and exit, in order, with its cause"
        )
        colour = "green" if agreed == expected else "red"
        console.print(f"[{colour}]EVENTS {agreed}/{expected}[/{colour}]")
    if again is None:
        advice = "Install it with: pip install 'dynhull[history]'"
        console.print(f"Not played again from the past, which needs pyarrow. {advice}", markup=False)
    elif steps == scene.length:
        console.print(f"The past that the server has kept, played again and compared: {again} {scene.step}")
        colour = "green" if again == scene.length else "red"
        console.print(f"[{colour}]REPLAYED {again}/{scene.length}[/{colour}]")


def _event_lines(events: list[FenceEvent]) -> list[str]:
    """The events since the line before, one line for each fence and kind."""
    by_fence: dict[tuple[str, str], list[FenceEvent]] = {}
    for event in events:
        by_fence.setdefault((event.fence, event.type), []).append(event)
    lines = []
    for (fence, kind), found in sorted(by_fence.items()):
        keys = [str(event.key) for event in found if event.key is not None]
        names = ": " + _listed(keys) if keys else ""
        lines.append(f"       {fence} {kind} {len(found)}{names}")
    return lines


def _listed(names: list[str]) -> str:
    more = f" and {len(names) - MOST_CORNERS} more" if len(names) > MOST_CORNERS else ""
    return ", ".join(names[:MOST_CORNERS]) + more


def _line(scene: Scene, step: ReplayStep) -> str:
    names = step.corners()
    return (
        f"{step.frame.clock:>5}  {len(step.frame.positions):>5,} {scene.counted}  {len(names):>3} vertices  "
        f"{step.area:>14,.0f} {scene.area_unit}  {_listed(names)}"
    )
