"""A scene in a line, and as a table for notebooks."""

from __future__ import annotations

import html
from typing import TYPE_CHECKING

from ..validation import counted

if TYPE_CHECKING:
    from ..hints import Scene

PARTICLE = 3  # coordinates of a point mass
SHOWN = 25  # rows at most of bodies, of constraints and of forces
HEAD = "<tr><th>name</th><th>kind</th><th></th></tr>"


def table(scene: Scene) -> str:
    """Bodies with their masses, constraints and forces with the bodies that they join."""
    bodies = [(body.name, type(body).__name__, f"{body.mass:g} kg") for body in scene.bodies]
    constraints = [one for one in scene.constraints if not getattr(one, "normalises", False)]
    rows = [*_rows(bodies), *_rows(map(_item, constraints)), *_rows(map(_item, scene.forces))]
    caption = html.escape(summary(scene).strip("<>"))
    return f"<table><caption>{caption}</caption>{HEAD}{''.join(rows)}</table>"


def summary(scene: Scene) -> str:
    """What `repr` says of a scene."""
    rows = sum(constraint.rows for constraint in scene.constraints)
    n = sum(body.dimension for body in scene.bodies)
    points = sum(body.dimension == PARTICLE for body in scene.bodies)
    parts = [(len(scene.bodies) - points, "rigid body", "rigid bodies"), (points, "point mass", "point masses")]
    bodies = ", ".join(counted(*part) for part in parts if part[0]) or "no bodies"
    forces = f", {counted(len(scene.forces), 'force')}" if scene.forces else ""
    return f"<Scene of {bodies}: {counted(n, 'coordinate')}, {counted(rows, 'constraint row')}{forces}>"


def _item(item):
    names = [body.name for body in (item.a, item.b) if body is not None]
    return item.name, item._kind(), ", ".join(names)


def _rows(lines):
    lines = list(lines)
    for line in lines[:SHOWN]:
        yield f"<tr>{''.join(f'<td>{html.escape(cell)}</td>' for cell in line)}</tr>"
    if len(lines) > SHOWN:
        yield f"<tr><td>and {len(lines) - SHOWN} more</td><td></td><td></td></tr>"
