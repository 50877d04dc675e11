"""The mirror image of a scene, with its parts in another order: the same motion, in the mirror."""

import numpy as np

from ..constraints import Translational, TranslationMotor
from ..elements.bodies import euler_product
from ..files.build import build, describe
from ..files.scene_text import Places
from ..files.types import Mistakes
from ..simulation.scene import Scene

# A mirror with normal n maps vectors by S = 1 - 2 n n^T, and axial ones (axes of turns, angular velocities) by -S.
# Within bodies x changes sign, by S0: A becomes S A S0 = (S A S) (S S0), a rotation again; Euler parameters (e0, e) of
# A are (e0, -S e) of S A S, and S S0 is a turn about z.

POLAR = Translational.__name__, TranslationMotor.__name__  # whose axes are not of turns
AXIAL, ITEMS, VECTORS = "axis", ("constraint", "force"), ("point", "center", "normal", "reference", "axis")


class Mirror:
    """A mirror that stands upright, at this angle (rad) from the x axis."""

    def __init__(self, angle):
        n = np.array((np.cos(angle), np.sin(angle), 0.0))
        self.S, self.own = np.eye(3) - 2.0 * np.outer(n, n), np.diag((-1.0, 1.0, 1.0))
        self.turn = np.array((n[0], 0.0, 0.0, n[1]))  # Euler parameters of S S0, a turn about z by twice the angle

    def scene(self, scene):
        """The scene in the mirror; bodies, constraints and forces in reverse order, but stops after their joints."""
        document = describe(scene)
        document["gravity"] = self._image(document["gravity"], self.S)
        document["body"] = [self._body(table) for table in document["body"][::-1]]
        for key in ITEMS:
            items = [self._item(table) for table in document.get(key, ())[::-1]]
            document[key] = sorted(items, key=lambda table: table["type"] == "Stop")
        mistakes = Mistakes("mirror", Places(""))
        made, _ = build(document, Scene, mistakes)
        mistakes.demand_none()
        return made

    def coordinates(self, scene, q):
        """Coordinates q (n,) of the scene as those of its image."""
        image, at = [], 0
        for body in scene.bodies:
            r, p = np.split(q[at : at + body.dimension], [3])
            image.append(np.concatenate((self.S @ r, self._turned(p) if p.size else p)))
            at += body.dimension
        return np.concatenate(image[::-1])

    def _turned(self, p):
        """Euler parameters of S A S0 = (S A S) (S S0)."""
        return euler_product(np.append(p[0], -self.S @ p[1:]), self.turn)

    def _image(self, vector, S):
        return (S @ np.array(vector)).tolist()

    def _body(self, table):
        found = dict(table)
        for name, S in (("position", self.S), ("velocity", self.S), ("angular_velocity", -self.own)):
            if name in table:
                found[name] = self._image(table[name], S)
        if "inertia" in table:
            found["orientation"] = self._turned(np.array(table.get("orientation", (1.0, 0.0, 0.0, 0.0)))).tolist()
            J = np.array(table["inertia"])
            found["inertia"] = J.tolist() if J.ndim == 1 else (self.own @ J @ self.own).tolist()
        return found

    def _item(self, table):
        found, polar = dict(table), table["type"] in POLAR
        for letter in "ab":
            S = self.S if table.get(letter) == "ground" else self.own
            for name in VECTORS:
                if (key := f"{name}_{letter}") in table:
                    found[key] = self._image(table[key], -S if name == AXIAL and not polar else S)
        if "points" in table:
            found["points"] = [[b, self._image(s, self.S if b == "ground" else self.own)] for b, s in table["points"]]
        return found
