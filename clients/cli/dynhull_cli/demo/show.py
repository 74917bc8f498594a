"""Shows a replay: its milestones, its largest hull and whether every step agreed."""

from pathlib import Path

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from dynhull_client import HullClient

from .replay import Step, replay
from .scene import Scene
from .server import server_process

MOST_CORNERS = 12  # named in a line


def show(console: Console, scene: Scene, out: Path) -> bool:
    """Replay a scene, print its milestones and draw the picture; returns whether every step agreed."""
    console.print(f"[bold]{scene.title}[/bold]")
    for note in scene.notes:
        console.print(note, markup=False)
    agreed = 0
    largest: Step | None = None
    difference = None
    columns = [BarColumn(), MofNCompleteColumn(), TextColumn(scene.step), TimeRemainingColumn()]
    with (
        server_process() as address,
        HullClient(address) as client,
        Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as progress,
    ):
        for step in progress.track(replay(client, scene), total=scene.length):
            if step.difference:
                difference = f"{step.frame.clock}: {step.difference}"
                break
            agreed += 1
            if largest is None or step.area > largest.area:
                largest = step
            if step.frame.milestone:
                console.print(_line(scene, step), markup=False)
    if largest and len(largest.vertices):
        from .picture import draw  # matplotlib takes a while to load, and only the end needs it

        draw(out, scene, largest)
        console.print(f"Largest at {largest.frame.clock}: {largest.area:,.0f} {scene.area_unit}. Picture: {out}")
    what = ", its keys with those that were sent," if scene.keyed else ""
    console.print(
        f"Live hull{what} compared with Chan's recomputation and with the watcher's copy: {agreed} {scene.step}"
    )
    if difference:
        console.print(f"[red]DIFFERENT[/red] at {difference}")
        return False
    console.print(f"[green]VERIFIED {agreed}/{scene.length}[/green]")
    return True


def _line(scene: Scene, step: Step) -> str:
    names = step.corners()
    corners = ", ".join(names[:MOST_CORNERS]) + (
        f" and {len(names) - MOST_CORNERS} more" if len(names) > MOST_CORNERS else ""
    )
    return (
        f"{step.frame.clock:>5}  {len(step.frame.positions):>5,} {scene.counted}  {len(names):>3} vertices  "
        f"{step.area:>14,.0f} {scene.area_unit}  {corners}"
    )
