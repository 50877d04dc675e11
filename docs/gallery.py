"""The gallery: examples in order, with what their pictures show. The pictures: python -m docs.draw gallery."""

from collections.abc import Callable
from importlib import import_module
from typing import NamedTuple

import numpy as np

import tsdyn as ts

OUTPUTS = 401


class Entry(NamedTuple):
    """An example: its module in examples/, the run that its picture shows, and the curve beside it."""

    name: str
    title: str
    end: float = 1.0  # s
    label: str = ""
    curve: Callable | None = None  # (module, solution) -> values (k,) or (k, n) at solution.t
    at: tuple[float, ...] = (0.0, 1.0)  # fractions of the time at which the scene is painted
    build: str = "build"
    run: Callable | None = None  # module -> Solution, where it is not a run of build()
    shapes: dict | None = None  # of bodies, by name, where the derived ones hide the mechanism
    draw: Callable | None = None  # (module, figure), where there is no scene to paint
    animated: bool = False  # whether its page shows the run, too

    @property
    def module(self):
        """The example, imported."""
        return import_module(f"examples.{self.name}")

    def solution(self):
        """The run that is painted."""
        if self.run:
            return self.run(self.module)
        times = np.linspace(0.0, self.end, OUTPUTS)
        build = getattr(self.module, self.build)
        return ts.simulate(build(), (0.0, self.end), t_eval=times, dense_output=True).raise_if_failed()


S = ts.shapes
CAR = {
    "chassis": S.Box((0.3, 0.08, 0.62), position=(0.0, 0.3, 0.45)),
    "upright": [S.Cylinder(0.28, 0.18, axis="y", position=(0.0, 0.12, 0.0)), S.Box((0.05, 0.05, 0.3))],
    "lower": S.Box((0.12, 0.4, 0.03)),
    "upper": S.Box((0.08, 0.27, 0.03)),
}
YOKE = {"wheel": S.Cylinder(0.115, 0.005, axis="z", position=(0, 0, -0.01))}
GOVERNOR = {
    "shaft": S.Cylinder(0.012, 0.65, axis="z", position=(0.0, 0.0, -0.27)),
    "sleeve": S.Cylinder(0.05, 0.08, axis="z"),
    "left": S.Sphere(0.05),
    "right": S.Sphere(0.05),
}
WOODPECKER = {
    "sleeve": [S.Box((0.0062, 0.006, 0.0116)), S.Capsule(0.0005, 0.01, axis="x", position=(0.005, 0, 0))],
    "bird": [
        S.Sphere(0.004),
        S.Capsule(0.002, 0.018, axis="z", position=(-0.002, 0, 0.009)),
        S.Capsule(0.0006, 0.017, axis="x", position=(-0.0115, 0, 0.02)),
    ],
}


def _rate(name):
    return lambda module, solution: solution.angle_rate(name)


def _map(module, figure):
    """Time to the first flip over both angles."""
    a, b, ensemble = module.run(30, 6.0)
    module.check(a, b, ensemble)
    shown = np.where(ensemble.kept > 6.0, np.nan, ensemble.kept).reshape(30, 30).T
    axes = figure.subplots()
    mesh = axes.imshow(shown, origin="lower", extent=(-180, 180, -180, 180), aspect="auto")
    figure.colorbar(mesh, label="first flip (s)")
    axes.set(xlabel="upper rod (degrees)", ylabel="lower rod (degrees)")


def _spread(module, figure):
    """How the swing of the rocker scatters."""
    ensemble, lengths = module.run()
    module.check(ensemble, lengths)
    axes = figure.subplots()
    axes.hist(np.degrees(ensemble.kept["swing"]), 25)
    axes.set(xlabel="swing of the rocker (degrees)", ylabel="cases")


def _tilts(module, figure):
    """Largest tilt against spin."""
    axes = figure.subplots()
    axes.plot(module.SPINS, np.degrees(module.by_threads()), "o-")
    axes.set(xlabel="spin (rad/s)", ylabel="largest tilt (degrees)")


SECTIONS = {
    "Linkages": (
        Entry("four_bar", "Four-bar", 0.8, "rate of the crank (rad/s)", _rate("bearing"), (0.0, 0.1, 0.2)),
        Entry("slider_crank", "Slider-crank", 0.8, "piston (m)", lambda m, s: s.position("piston")[:, 0], (0.0, 0.15)),
        Entry(
            "chebyshev_linkage",
            "Chebyshev's straight line",
            np.pi,
            "guided point, x and y (m)",
            lambda m, s: m.path(s),
            (0.0, 0.3),
            run=lambda m: m.build().kinematics(np.linspace(0.0, np.pi, OUTPUTS)),
        ),
        Entry("peaucellier", "Peaucellier's exact straight line", 2.0, "y of D (m)", lambda m, s: m.guided(s)[:, 1]),
        Entry(
            "scotch_yoke", "Scotch yoke", 0.5, "rate of the wheel (rad/s)", _rate("bearing"), (0.0, 0.3), shapes=YOKE
        ),
        Entry("sarrus", "Sarrus linkage", 0.4, "height (m)", lambda m, s: s.position("platform")[:, 2]),
        Entry("bricard", "Bricard's six-bar", 1.5, "two angles (rad)", lambda m, s: m.angles(s)[:, :2], (0.0, 0.5)),
        Entry(
            "andrews_squeezer", "Andrews' squeezer", 0.03, "beta (rad)", lambda m, s: s.angle(s.scene.constraints[0])
        ),
        Entry("stewart_platform", "Stewart platform", 2.09, "forces of legs (N)", lambda m, s: m.forces(s), (0.0, 0.5)),
        Entry("delta_robot", "Delta robot from URDF", 1.0, "torques (N m)", lambda m, s: m.torques(s), (0.0, 0.3)),
        Entry(
            "leg_with_rods",
            "Leg with rods from URDF",
            1.0,
            "knee, ankle (rad)",
            lambda m, s: np.stack([s.angle(name) for name in ("knee", "ankle pitch", "ankle roll")], 1),
            (0.0, 0.25),
        ),
        Entry(
            "suspension", "Double-wishbone suspension", 2.0, "ride (m)", lambda m, s: s.displacement("ride"), shapes=CAR
        ),
    ),
    "Pendulums and tops": (
        Entry("double_pendulum", "Double pendulum", 3.0, "angles (rad)", lambda m, s: m.angles(s).T, (0.0, 0.2, 0.4)),
        Entry("two_body_pendulum", "Two-body pendulum", 2.0, "energy (J)", lambda m, s: s.kinetic_energy),
        Entry("pendulum_chain", "Chain", 1.0, "kinetic energy (J)", lambda m, s: s.kinetic_energy, (0.0, 0.5, 1.0)),
        Entry(
            "driven_pivot",
            "Pendulum on a shaken pivot",
            3.0,
            "angle (rad)",
            lambda m, s: m.angle(s),
            build="build_driven",
        ),
        Entry("door", "Door on three hinges", 10.0, "turn (rad)", lambda m, s: m.turn(s), (0.0, 0.15)),
        Entry("top", "Sliding top", 10.0, "tilt (rad)", lambda m, s: m.tilt(s)),
        Entry("gyroscope", "Steady precession", 3.0, "precession (rad)", lambda m, s: m.turn_and_tilt(s)[0]),
        Entry("flyball_governor", "Flyball governor", 3.0, "arms (rad)", lambda m, s: m.angle(s), shapes=GOVERNOR),
        Entry("stability_map", "Stability map of a double pendulum", draw=_map),
    ),
    "Rolling": (
        Entry(
            "bicycle",
            "The Whipple bicycle balances itself",
            3.0,
            "lean (rad)",
            lambda m, s: m.lean(s),
            (0.0, 0.15),
            animated=True,
        ),
        Entry(
            "coin",
            "A coin in a steady turn",
            2.5,
            "contact point (m)",
            lambda m, s: s.contact_point("contact")[:, :2],
            (0.0, 0.3, 0.6),
            animated=True,
        ),
        Entry(
            "turntable",
            "Ball on a turntable",
            np.pi,
            "x, y (m)",
            lambda m, s: s.position("ball")[:, :2],
            (0.0, 0.5),
            animated=True,
        ),
        Entry(
            "rattleback",
            "A rattleback turns back",
            5.0,
            "spin (rad/s)",
            lambda m, s: m.spin(s),
            (0.0, 0.6),
            animated=True,
        ),
        Entry(
            "two_wheeled_robot",
            "A robot on two wheels",
            5.0,
            "pitch (rad)",
            lambda m, s: np.arcsin(s.rotation("body")[:, 0, 2]),
            (0.0, 0.1, 1.0),
            build="controlled",
        ),
    ),
    "Drives": (
        Entry("hooke_joint", "Universal joint", 3.0, "speeds (rad/s)", lambda m, s: np.stack([*m.speeds(s)], axis=1)),
        Entry("cardan_shaft", "Cardan shaft", 1.0, "speeds (rad/s)", lambda m, s: m.speeds(s).T),
        Entry("geared_pair", "Gear pair", 1.5, "turn of the wheel (rad)", lambda m, s: m.turn(s, "wheel")),
        Entry("differential", "Differential", 2.0, "cage, left, right (rad)", lambda m, s: m.turns(s).T),
        Entry("planetary_gear", "Planetary gear", 0.5, "sun, carrier (rad/s)", lambda m, s: np.stack([*m.rates(s)], 1)),
        Entry("drive_train", "Drive train with brake", 4.0, "kinetic energy (J)", lambda m, s: s.kinetic_energy),
        Entry("hoist", "Hoist with a rope", 3.0, "tension (N)", lambda m, s: m.tension(s), (0.0, 0.2)),
        Entry("screw_press", "Screw press", 1.5, "platen (m)", lambda m, s: s.position("platen")[:, 2]),
        Entry("stick_slip", "Stick-slip", 2.0, "slide (m)", lambda m, s: s.position("slide")[:, 0]),
    ),
    "Contact": (
        Entry(
            "bouncing_balls", "Bouncing balls", 5.0, "height (m)", lambda m, s: m.heights(s), (0.0, 0.4), animated=True
        ),
        Entry("cradle", "Newton's cradle", 1.2, "first, last (m)", lambda m, s: m.ends(s), (0.0, 0.5), animated=True),
        Entry(
            "box_stack", "A stack of boxes", 1.0, "heights (m)", lambda m, s: m.heights(s), (0.0, 0.5), animated=True
        ),
        Entry(
            "woodpecker",
            "Woodpecker toy",
            0.9,
            "sleeve (m)",
            lambda m, s: s.position("sleeve")[:, 2],
            (0.0, 0.1),
            shapes=WOODPECKER,
            animated=True,
        ),
        Entry(
            "clearance",
            "Slider-crank with clearance",
            0.1,
            "slider / play",
            lambda m, s: m.offset(s),
            (0.0, 0.1),
            shapes={"slider": S.Box((0.1, 0.05, 0.05))},
        ),
    ),
    "Control": (
        Entry(
            "swing_up",
            "Swing-up of a double pendulum on a cart",
            12.0,
            "hip, knee (rad)",
            lambda m, s: np.stack([s.angle("hip"), s.angle("knee")], axis=1),
            (0.0, 0.62, 1.0),
            build="controlled",
        ),
        Entry(
            "computed_torque",
            "Computed torque of a five-bar robot",
            1.6,
            "beside the path, x and z (m)",
            lambda m, s: m.error(s)[0][:, [0, 2]],
            (0.0, 0.4),
            build="controlled",
        ),
        Entry(
            "active_suspension",
            "Active suspension of a quarter car",
            6.0,
            "body, wheel (m)",
            lambda m, s: np.stack([s.displacement("body guide"), s.displacement("wheel guide")], axis=1),
        ),
    ),
    "Hybrid systems": (
        Entry(
            "clutch",
            "Clutch and brake",
            5.0,
            "driver, load (rad/s)",
            lambda m, s: np.stack([s.angle_rate(f"{name} hinge") for name in ("driver", "load")], axis=1),
            run=lambda m: ts.simulate(m.build(), (0.0, 5.0), events=m.events(), dense_output=True),
        ),
        Entry(
            "catapult",
            "Catapult",
            1.5,
            "stone (m)",
            lambda m, s: s.position("stone")[:, [0, 2]],
            run=lambda m: m.shoot(),
        ),
        Entry(
            "docking",
            "Docking",
            100.0,
            "spins of station, probe (rad/s)",
            lambda m, s: np.stack([s.angular_velocity(name)[:, 2] for name in ("station", "probe")], axis=1),
            (0.0, 0.3),
            run=lambda m: m.fly(),
        ),
        Entry(
            "compass_walker",
            "Compass walker",
            12.0,
            "feet (m)",
            lambda m, s: np.stack([s.position(name)[:, 0] for name in m.FEET], axis=1),
            (0.0, 0.5, 1.0),
            run=lambda m: m.walk(12.0),
        ),
    ),
    "Plug-ins and studies": (
        Entry("bead_on_surface", "A constraint of your own", 5.0, "bead (m)", lambda m, s: s.position("bead")),
        Entry(
            "plug_in_integrator", "An integrator of your own", 2.0, "kinetic energy (J)", lambda m, s: s.kinetic_energy
        ),
        Entry(
            "inverse_dynamics",
            "Inverse dynamics of a five-bar robot",
            1.0,
            "torques (N m)",
            lambda m, s: np.stack([*m.solve(s.t).loads.values()], axis=1),
            (0.0, 0.4),
            run=lambda m: m.solve(np.linspace(0.0, 1.0, 201)),
        ),
        Entry("tolerance_analysis", "Tolerance analysis", draw=_spread),
        Entry("parallel_runs", "Parallel runs", draw=_tilts),
    ),
}
ENTRIES = tuple(entry for entries in SECTIONS.values() for entry in entries)
