"""The elements of a scene: bodies, markers, constraint primitives, joints, forces; the interfaces of plug-ins.

Imports jit, maths and motions. constraints/ and forces/ are written on this package, a file a class.

Begin with markers.py (points, vectors and orientations on bodies), then element.py (two bodies, a name, checked
attributes), primitive.py (a constraint and its kernels), joint.py (a constraint composed of others), force.py. The
kernels of primitives and forces are compiled into the loops over all instances of a kind, in loops/.
"""
