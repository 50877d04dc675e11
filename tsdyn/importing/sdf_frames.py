"""Frames of an SDF model: links, joints, frames and inner models, each given in another one."""

import numpy as np

from .frames import HERE, Frame, of_quaternion, roll_pitch_yaw

MODEL = "__model__"


class Frames:
    """The frames of a model by name.

    Parameters
    ----------
    model : Node
    outer : Frame
        In which the model is given, in the ground frame.
    report : ImportReport
    """

    def __init__(self, model, outer, report):
        self.report, self._known, self._parents = report, {}, {}
        self._owners = {}  # of frames that have been asked for
        for node in (*model.all("link"), *model.all("model")):
            self._add(node, MODEL)
        for node in model.all("frame"):
            self._add(node, node.get("attached_to") or MODEL)
        for node in model.all("joint"):
            child = node.one("child")
            self._add(node, child.text if child is not None else MODEL)
        self.node = model
        if model.get("placement_frame"):
            model.wrong("<model placement_frame>: write the pose of the model itself.")
        self._at = {MODEL: outer @ self.pose(model)}

    def _add(self, node, parent):
        name = node.get("name")
        if name:
            self._known.setdefault(name, node)
            self._parents.setdefault(name, parent)

    def pose(self, node):
        """The frame of a child <pose>, in that which it is relative to."""
        child = node.one("pose")
        if child is None or not child.text:
            if child is not None:
                _ = child.get("frame"), child.get("relative_to")
            return HERE
        _ = child.get("frame"), child.get("relative_to")
        degrees = (child.get("degrees") or "").lower() in ("1", "true")
        if child.get("rotation_format") == "quat_xyzw":
            values = child.numbers(child.text, 7, [0, 0, 0, 0, 0, 0, 1], "<pose>")
            return Frame(values[:3], of_quaternion(np.roll(values[3:], 1)))
        values = child.numbers(child.text, 6, np.zeros(6), "<pose>")
        return Frame(values[:3], roll_pitch_yaw(values[3:], degrees=degrees))

    def resolve(self, name, node=None):
        """A frame, by name, in the ground frame."""
        name = name or ""  # of what lacks one, which is a mistake already
        waiting, at = {}, None
        while at is None and (at := self._at.get(name)) is None:
            if name in ("world", ""):
                at = HERE
            elif name not in self._known and "::" in name:
                at = self._inner(name, node)
            elif name not in self._known or name in waiting:
                what = "there is no frame" if name not in self._known else "poses form a circle at"
                (node or self.node).wrong(f"{what} {name!r}.")
                at = HERE
            else:
                node = waiting[name] = self._known[name]
                child = node.one("pose")
                named = None if child is None else child.get("relative_to") or child.get("frame")
                name = named or self._parents[name]
        for name, node in reversed(waiting.items()):
            at = self._at[name] = at @ self.pose(node)
        return at

    def _inner(self, name, node):
        (node or self.node).wrong(f"the frame {name!r} of an inner model can't be referred to; give the pose itself.")
        return HERE

    def link_of(self, name):
        """The link that a frame is attached to; the name itself where it is none."""
        seen = {}
        while name in self._known and self._known[name].tag in ("frame", "joint") and name not in seen:
            seen[name] = None
            name = self._owners.get(name) or self._parents[name]
        self._owners.update(dict.fromkeys(seen, name))
        return name
