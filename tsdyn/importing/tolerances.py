"""Limits of the import, with where they come from."""

NO_MASS = 1e-12  # kg; below, a link is a frame: drivers of CAD write 1e-15 or less for none
NO_INERTIA = 1e-15  # kg m^2, of the largest entry: a cube of steel with edges of 0.6 mm
HUGE = 1e50  # kg, kg m^2 or m: mass times length squared, and its square, are finite below
SLIGHT = 1e-6  # of the median mass: links with less are given a share of their neighbours', or rounding would grow
SHARE = 0.5  # of what a donor could give: both keep what is well-conditioned
HALVINGS = 30  # of a share, until a body keeps half of its least moment of inertia
REACH = 0.1  # m: of a rod on an axis of the ground, where its length changes nothing

OBJECTS = 1 << 16  # elements of MJCF, copies included: half a gigabyte in MuJoCo's compiler and in the scene
CELLS = 1 << 22  # of a height field: 16 MB
TEXT = 1000  # characters of attributes that count as one object more
PARTS = 8  # objects a body of <composite> or <flexcomp>: joint, geom, edges, elements
FOLDERS = 32  # of meshes in an MJCF file, in each of which each mesh is looked for
