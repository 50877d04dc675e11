"""Parameters of a scene: what may vary from run to run, by name, and the packed numbers of other values.

Imports model, sparse and below, and docstrings, which state the units.

Begin with fields.py (the attributes of bodies, constraints and forces that may be set, with their units). listing.py
is what `scene.parameters()` returns. Scenes of a family (family.py) share their analysis: edit.py writes the numbers of
other values into copies of the packed arrays.
"""
