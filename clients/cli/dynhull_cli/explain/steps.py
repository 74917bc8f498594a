"""From a trace to steps: the chain, the points being tested, the points discarded."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

from dynhull import static
from dynhull.static.trace import Collinear, Event, Groups, Pop, Push, Round, Scan, Trace, Turn, Wrap

from .scene import Point, plural, text

TURNS = {1: "left", 0: "straight on", -1: "right"}


@dataclass(frozen=True, slots=True)
class Step:
    """One picture.

    Attributes:
        caption: what happens.
        chain: the points on the chain, from bottom to top.
        finished: chains of earlier passes.
        discarded: points taken off the chain in this pass.
        triple: the points being tested, as a path: three whose turn is evaluated, or a tangent.
        sign: which way they turn.
        groups: vertices of each group's hull.
        tangents: points where tangents from the top of the chain touch the groups.
        hull: the hull's vertices, in the last step only.
        order: the points of the pass, in the order in which the pass reads them.
    """

    caption: str
    chain: tuple[Point, ...] = ()
    finished: tuple[tuple[Point, ...], ...] = ()
    discarded: tuple[Point, ...] = ()
    triple: tuple[Point, ...] = ()
    sign: int = 0
    groups: tuple[tuple[Point, ...], ...] = ()
    tangents: tuple[Point, ...] = ()
    hull: tuple[Point, ...] = ()
    order: tuple[Point, ...] = ()


def explained(algorithm: str, xy: Sequence[Point], collinear: Collinear) -> list[Step]:
    """The steps of one of the algorithms of `dynhull.static`, by its name."""
    trace: Trace = []
    hull = getattr(static, algorithm)(xy, collinear=collinear, trace=trace)
    return list(_steps(trace, [(x, y) for x, y in hull.tolist()]))


def _steps(trace: Trace, hull: Sequence[Point]) -> Iterator[Step]:
    """The steps of a trace, and the hull as the last. A turn and the push or pop that it decides are one step."""
    now = Step("")
    turn: Turn | None = None
    for event in trace:
        match event:
            case Turn() if event.a == now.chain[-1]:
                yield replace(now, caption=_candidate(event), triple=(event.b, event.a, event.c), sign=event.sign)
            case Turn():
                turn = event
            case Push() | Pop() if turn:
                yield _decided(now, turn, event)
                turn = None
                now = _apply(now, event)
            case Push() | Pop():
                now = _apply(now, event)
                yield replace(now, caption=f"push {text(event.point)}")
            case Scan() | Groups() | Wrap() | Round():
                now = _apply(now, event)
                yield now
    yield Step(f"the hull: {plural(len(hull), 'vertex', 'vertices')}", hull=tuple(hull))


def _decided(now: Step, turn: Turn, event: Push | Pop) -> Step:
    action = "push" if isinstance(event, Push) else "pop"
    caption = f"{cross(turn)}: {TURNS[turn.sign]}\n{action} {text(event.point)}"
    return replace(now, caption=caption, triple=(turn.a, turn.b, turn.c), sign=turn.sign)


def _candidate(turn: Turn) -> str:
    verdict = "better" if turn.sign < 0 else "on one line" if turn.sign == 0 else "no better"
    return f"{cross(turn)}: {TURNS[turn.sign]}\n{text(turn.c)} is {verdict}"


def _apply(now: Step, event: Event) -> Step:
    """The picture after an event."""
    match event:
        case Scan(name, order):
            finished = (*now.finished, now.chain) if now.chain else ()
            return Step(f"{name}: the order of the points", finished=finished, order=order)
        case Push(point):
            return replace(now, chain=(*now.chain, point))
        case Pop(point):
            return replace(now, chain=now.chain[:-1], discarded=(*now.discarded, point))
        case Groups(guess, hulls):
            count = f"{len(hulls)} group{'s' if len(hulls) > 1 else ''}"
            return Step(f"guess {guess}: hulls of {count}\nof at most {guess} points", groups=hulls)
        case Wrap(vertex, tangents, best):
            chain, caption = (*now.chain, vertex), f"tangents from {text(vertex)}\nthe rightmost goes to {text(best)}"
            return replace(now, caption=caption, chain=chain, tangents=tangents, triple=(vertex, best), sign=1)
        case Round(guess, _, count, _, closed):
            end = f"closed: {count} vertices" if closed else f"not closed after {count} steps:\ndiscarded, guess again"
            chain = (*now.chain, *now.triple[1:])  # the edge of the last step
            return replace(now, caption=f"guess {guess}, {end}", chain=chain, triple=(), tangents=())
        case Turn():
            return now


def cross(turn: Turn) -> str:
    """The cross product as text: exact where it is short, otherwise rounded; "0" only where it is zero."""
    value = turn.cross
    if value.denominator == 1 and abs(value) < 10**6:
        return f"cross product {value.numerator}"
    try:
        rounded = f"{float(value):.3g}"
    except OverflowError:
        return f"cross product {'> 1e308' if value > 0 else '< -1e308'}"
    if float(rounded) == 0:
        return f"cross product {'> 0, below 5e-324' if value > 0 else '< 0, above -5e-324'}"
    return f"cross product {rounded}"
