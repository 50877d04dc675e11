"""Scenes that differ in numbers: one analysis, one packing, and the numbers of each.

A value that only enters numbers of the packed arrays (mass, inertia, gravity, a start, what a force or a primitive gets
as par, where their markers are, those of the parts of a joint) is written into a copy of those arrays. All else, such
as functions of time, or a joint whose coordinate a force measures, asks for the scene to be packed anew.
"""

from ..elements.joint import Joint
from ..jit.code_hash import is_ours
from ..model.handles import handles_of
from ..model.lengths import reaches_of
from ..model.packed import classes
from .edit import Edit
from .fields import fields_of, unknown_field


class Family:
    """A scene as it was packed, and what scenes with other parameters share with it.

    Parameters
    ----------
    packed : Packed
    start : tuple of ndarray
        q and qd (n,) of the bodies.
    template : Scene
        A copy of the scene that nobody edits.
    """

    def __init__(self, packed, start, template):
        self.packed, self.start, self.template = packed, start, template
        self.fields, self.shared = fields_of(template), {}
        handles_of(packed)
        self.members = {id(item): i for i, item in enumerate(template.constraints)}
        bodies = zip((template.ground, *template.bodies), (packed.bodies[0].scene.ground, *packed.bodies), strict=True)
        self._bodies = {id(body): own for body, own in bodies}
        self.loads = {id(force): i for i, force in enumerate(template._forces)}
        self._structural = {}
        self.begins = self._find_begins()
        self.reaches = [reaches_of(*pair) for pair in zip(packed.constraints, packed.coordinates, strict=True)]

    def _find_begins(self):
        """Where the reals of each primitive begin."""
        taken, rows, found = {}, dict(zip(classes(self.packed), self.packed.system.kinds, strict=True)), []
        for primitive in self.packed.constraints:
            row, at = rows[type(primitive)], taken.get(type(primitive), 0)
            found.append(int(row.reals + at * row.stride))
            taken[type(primitive)] = at + 1
        return found

    def field(self, name):
        """The `Field` of a name; raises InvalidArgument."""
        try:
            return self.fields[name]
        except (KeyError, TypeError):
            raise unknown_field(name, self.fields) from None

    def load_of(self, owner):
        """The `Load` of a force of the template; None for a constraint."""
        i = self.loads.get(id(owner))
        return None if i is None else self.packed.loads[i]

    def is_structural(self, owner, attributes):
        """Whether more than numbers may follow from some attributes of a constraint or force."""
        known = self._structural.get(id(owner))
        if known is None:
            items = (*self.template._added, *self.template._forces)
            known = self._structural[id(owner)] = (
                getattr(owner, "period", None) is not None
                or (isinstance(owner, Joint) and not is_ours(type(owner).__module__))
                or any(value is owner for item in items for value in vars(item).values())
            )
        if isinstance(owner, Joint):
            return known
        places = [marker.argument for marker in owner.markers] if owner.joint_coordinates else []
        return known or hasattr(owner, "opposed") or any(name in places for name in attributes)

    def own_body(self, body):
        """The body of the packed scene that one of the template stands for."""
        return self._bodies.get(id(body), body)

    def numbers(self, values):
        """The `Packed` and the start of a scene with other values, by name; None if it must be packed anew.

        Raises
        ------
        TsdynError
            As the attribute does when it is set.
        """
        edit, groups = Edit(self), {}
        for name, value in values.items():
            field = self.field(name)
            owner, changes = groups.setdefault(id(field.owner), (field.owner, {}))
            present = changes[field.attribute] if field.attribute in changes else getattr(owner, field.attribute)
            changes[field.attribute] = field.entered(value, present)
        for owner, changes in groups.values():
            if not edit.enter(owner, changes):
                return None
        return edit.result()
