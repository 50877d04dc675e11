"""What a scene is made of: bodies, markers, constraint primitives, joints, forces; and the interface of plug-ins.

Imports jit, maths and motions. constraints/ and forces/ are written on this package, a file a class.

Begin with markers.py (points, vectors and orientations on bodies), then element.py (two bodies, a name, checked
attributes), primitive.py (a constraint and its kernels), joint.py (a constraint made of others), force.py. The loops
over all instances of a kind, in loops/, are the code that primitives and forces are compiled into.
"""
