"""Files of robots and mechanisms in URDF, MJCF and SDF, read as scenes. Nothing of a file is executed.

Imports constraints, forces, shapes and what lies below them, and the mistakes of `files`; the class of the scene is
passed in.

Begin with reading.py: the kind of a file, and the way from a file to a scene. urdf.py, sdf.py and mjcf.py each make a
`Description` (description.py) in the ground frame; reduction.py adds what trees leave open, merges
fixed links and gives massless links a share of their neighbours' mass; reading.py adds bodies, joints and forces to a
scene. The `ImportReport` of description.py lists what is lost.
"""
