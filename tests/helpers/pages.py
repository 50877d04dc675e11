"""What the page of an animation holds: its data, decoded."""

import base64
import json
import re
from html.parser import HTMLParser
from types import SimpleNamespace

import numpy as np

from tsdyn.elements.bodies import rotation_matrix

FULL = 32767.0  # of int16


class Tags(HTMLParser):
    """The tags of a page, in order, and its addresses."""

    def __init__(self, page):
        super().__init__()
        self.opened, self.closed, self.addresses = [], [], []
        self.feed(page)

    def handle_starttag(self, tag, attributes):
        self.opened.append(tag)
        self.addresses += [value for name, value in attributes if name in ("src", "href", "srcset", "data")]

    def handle_endtag(self, tag):
        self.closed.append(tag)


def decoded(page):
    """The data of a page: JSON as it is, and arrays."""
    text = re.search(r'<script type="application/json" id="run">(.*?)</script>', page, re.DOTALL)[1]
    run = SimpleNamespace(**json.loads(text))
    bodies = len(run.bodies)
    run.positions = array(run.positions, "<f4").reshape(run.frames, bodies, 3) + np.array(run.origin)
    run.rotations = array(run.rotations, "<i2").reshape(run.frames, bodies, 4) / FULL
    run.loads = array(run.loads, "<i2").reshape(len(run.arrows), run.frames, 3) / FULL
    run.t = np.linspace(*run.time, run.frames)
    return run


def array(text, kind):
    """An array from base64."""
    return np.frombuffer(base64.b64decode(text), kind)


def place(run, frame, body, point):
    """Where a point of a body is at a frame, m; body -1 is the ground."""
    if body < 0:
        return np.array(point)
    p = np.roll(run.rotations[frame, body], 1)
    return run.positions[frame, body] + rotation_matrix(p / np.linalg.norm(p)) @ point
