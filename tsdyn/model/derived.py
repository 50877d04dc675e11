"""What has been worked out from a packed scene, once, for whoever asks next."""

from dataclasses import dataclass, field


@dataclass(slots=True)
class Derived:
    """Of one `Packed`: each entry is None, or empty, until the function named beside it has been called."""

    redundant: object = None  # int64 (k,): redundant rows of the constraint graph; constraint_graphs.set_redundant
    turning: set = field(default_factory=set)  # bodies that count as turning; locked_orientations.keep_turning
    handles: object = None  # handles.handles_of
    body_indices: dict = None  # packed.index_of
    members: dict = None  # packed.member_of
    short_rows: object = None  # a `System`: sparse_jacobian.with_short_rows
    graph: tuple = None  # constraint_graph.graph_of, and by the loops asked for:
    graphs: dict = field(default_factory=dict)
    locked: object = None  # a `Still`: locked_orientations.still
    moving_graph: tuple = None  # locked_orientations.moving_graph, and by the loops asked for:
    moving_networks: dict = field(default_factory=dict)
    saddle: tuple = None  # a graph, a system, and their `SaddleGraph`: saddle_graph.saddle_of
    examined: object = None  # a `Packed` without redundant rows so far: dependent_rows.dependent_rows
    start_workspaces: list = field(default_factory=list)  # idle: start_workspace.taken
    aligned: tuple = None  # mirrored_branches.demand_aligned
    holonomic: bool = False  # whether plug-ins have been found so: holonomic.demand_holonomic
    loads: dict = None  # reactions.loads_of
    row_parts: list = field(default_factory=list)  # idle: observables.row_parts.taken
    places_within: list = None  # of each primitive among those of its class: reactions.only
    coordinate_starts: dict = None  # diagnostics.starts
    engines: dict = field(default_factory=dict)  # scene_cache.Prepared.engine
    levers: object = None  # (bodies,), m: rounding_limit.within_rounding, and the start last found near the origin:
    near: object = None
    grounded: tuple = None  # local_origin.origin_of, and for the start last seen:
    origin: tuple = (None, None)
    local: tuple = None  # the scene from an origin of its own: local_origin
    family: object = None  # a parameters.family.Family: variants.family_of
    shared: dict = None  # of a family: what numbers don't change, by the functions that find it; None for one scene

    @property
    def is_of_start(self):
        """Whether some of it holds where runs have started: redundant rows, bodies that turn, a local origin."""
        return self.redundant is not None or bool(self.turning) or self.local is not None

    def forget_graphs(self):
        """The constraint graph is another."""
        self.graph = None
        self.graphs.clear()
        self.forget_locked()

    def forget_locked(self):
        """Other bodies turn."""
        self.locked = self.moving_graph = None
        self.moving_networks.clear()
        self.engines = {}  # and not cleared: a run in another thread may be about to add one

    def __reduce__(self):
        """In another process: what doesn't depend on where things are in memory."""
        return _of, (self.redundant, self.turning, self.handles)


def _of(redundant, turning, handles):
    return Derived(redundant, turning, handles)
