"""The scene file that `tsdyn new` writes."""

TEXT = """\
# A scene of tsdyn. SI units and radians; Euler parameters scalar first.
# Run it:    tsdyn run scene.toml
# Check it:  tsdyn check scene.toml        What is in it:  tsdyn info scene.toml
version = 1
title = "pendulum with a spring"
gravity = [0.0, 0.0, -9.81]

# Numbers with names. A number anywhere below may be an expression of them, in quotes.
[parameters]
length = 1.0
mass = 2.0

# A rigid body; type = "PointMass" is a particle, without inertia and orientation.
[[body]]
name = "arm"
mass = "mass"
inertia = [0.01, "mass * length**2 / 12", "mass * length**2 / 12"] # about the centroid, body frame
position = ["length / 2", 0, 0]                                    # of the centroid, ground frame
# orientation = [1, 0, 0, 0]
# velocity = [0, 0, 0]
# angular_velocity = [0, 0, 0]                                     # body frame

# A joint. `at` gives its point and axis in the ground frame; without it point_a, axis_b, ... are in the body frames.
[[constraint]]
type = "Revolute"
name = "hinge"
a = "ground"
b = "arm"
at = { point = [0, 0, 0], axis = [0, 1, 0] }

# A motor would prescribe the angle, as an expression of the time t:
# [[constraint]]
# type = "RotationMotor"
# a = "ground"
# b = "arm"
# at = { axis = [0, 1, 0] }
# angle = "0.5 * sin(2 * t)"

[[force]]
type = "Spring"
name = "spring"
a = "arm"
b = "ground"
point_a = ["length / 2", 0, 0]
point_b = ["length", 0, 0.5]
stiffness = 20.0
damping = 0.1

# assemble = true moves bodies that don't quite fit to the nearest places where they do.
[start]
assemble = false

[run]
end = 10.0
every = 0.01 # outputs; without it one a step
# method = "dop853"
# rtol = 1e-9

# Results of `tsdyn run` and `tsdyn ensemble`, below the working folder.
# [output]
# files = ["arm.h5", "arm.csv"]
# plot = "arm.png"

# Many runs, by `tsdyn ensemble`: what differs from case to case. `tsdyn info --parameters` lists them.
# [ensemble]
# cases = 100
# [ensemble.parameters]
# "arm.mass" = { normal = [2.0, 0.05] }
# "spring.stiffness" = { uniform = [15, 25] }
"""
