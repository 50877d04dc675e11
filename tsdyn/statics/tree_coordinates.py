"""Minimal coordinates of a tree of joints by its structure: those of the joints, rotations beyond ball joints.

A joint whose own coordinates are as many as its freedoms gives these; one that holds a point and nothing else, the
rotation of the body beyond it; a body that nothing leads to from the ground, its displacement and rotation.
"""

from collections import deque

BALL = 3  # rows
FREE = 6  # of two bodies without joint


def of_tree(motion, variations):
    """The `Variation`s (k,) of a tree of joints, those of joints first; None where the scene is no such tree."""
    packed = motion.packed
    if not motion.rigid.all():
        return None
    numbers = {body: i for i, body in enumerate(packed.bodies)}
    own = {id(row.item): len(row.angles) + len(row.displacements) for row in variations.handles.rows}
    neighbours, count = [[] for _ in range(len(numbers) + 1)], 0  # the ground is the last
    for member in packed.members:
        item = member.constraint
        if getattr(item, "normalises", False):
            continue
        rows = member.rows.stop - member.rows.start
        ball = rows == BALL and not own.get(id(item), 0)
        if not (ball or rows + own.get(id(item), 0) == FREE):
            return None
        a, b = (numbers.get(body, len(numbers)) for body in (item.a, item.b))
        neighbours[a].append((b, ball))
        neighbours[b].append((a, ball))
        count += 1
    turning, free = _beyond(neighbours)
    if count != len(numbers) - len(free):
        return None  # loops
    found = list(variations.joints)
    for i in sorted(free):
        found += variations.of_body(packed.bodies[i])
    found += variations.rotations([packed.bodies[i] for i in sorted(turning)])
    return found if len(found) == motion.freedom else None


def _beyond(neighbours):
    """Numbers of the bodies beyond ball joints, and of those that parts without ground begin with."""
    turning, free, seen = set(), set(), set()
    for root in (len(neighbours) - 1, *range(len(neighbours) - 1)):
        if root in seen:
            continue
        if root < len(neighbours) - 1:
            free.add(root)
        seen.add(root)
        waiting = deque([root])
        while waiting:
            for other, ball in neighbours[waiting.popleft()]:
                if other not in seen:
                    seen.add(other)
                    waiting.append(other)
                    if ball:
                        turning.add(other)
    return turning, free
