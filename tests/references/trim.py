"""Trim the project's reference solutions to what the tests need: python tests/references/trim.py FOLDER.

FOLDER holds the full files (definition, residuals, accelerations, multipliers and more), computed in quadruple
precision by two methods, neither of them the tangent-space method: minimal coordinates without Euler parameters by
20th-order Gauss-Legendre collocation, and absolute coordinates with multipliers (index 1) by extrapolation (GBS). The
digits on which the two agree are vouched for. Written beside this script, as 64-bit floats, at most 17 digits each:

    source       how the numbers were made, and the largest disagreement of the two methods
    digits       digits vouched for
    definition   gravity; bodies; constraints as (class of tsdyn.constraints, body a, body b, arguments), ground = 0;
                 forces, if any, as (class of tsdyn.forces, bodies, arguments), constant, not part of the energy
    t, r, A, v, w_body, energy
                 output times, centroids, rotation matrices (rows first), velocities, body angular velocities, J

tests/simulation/test_references.py recomputes these numbers from equations of its own.
"""

import json
import sys
from pathlib import Path

LAST = {  # of the output times; later ones are beyond what double precision can follow, or too long for a test
    "sliding_top": 10.0,
    "two_body_pendulum": 10.0,
    "two_body_pendulum_spatial": 10.0,
    "sleeping_top_unstable": 30.0,
    "sleeping_top_stable": 30.0,
    "chain_4": 1.0,
    "chain_16": 1.0,
}


def constraint(row):
    """Say a constraint in the words of tsdyn; the files write j - i, which leaves the zero set as it is."""
    kind, i, j = row["type"], row.get("i", 0), row["j"]
    if kind == "SPH":
        return "Spherical", i, j, {"point_a": row["a"], "point_b": row["b"]}
    if kind == "DIST":
        return "Distance", i, j, {"point_a": row["a"], "point_b": row["b"], "length": row["L"]}
    if kind == "PLANE":  # normal . (r_j + A_j b) = L
        foot = [c * row["L"] for c in row["c"]]
        return "PlaneContact", j, 0, {"point_a": row["b"], "point_b": foot, "normal_b": row["c"]}
    raise ValueError(f"no row for {kind}")


def force(row):
    """Say a force in the words of tsdyn: a constant force, ground frame, on a point of one body."""
    if row["type"] != "FORCE":
        raise ValueError(f"no force for {row['type']}")
    return "PointForce", row["j"], {"point_a": row["b"], "force": row["c"]}


def body(row):
    """Say a body in the words of tsdyn."""
    xx, yy, zz, xy, xz, yz = row["inertia_xx_yy_zz_xy_xz_yz"]
    return {
        "mass": row["mass"],
        "inertia": [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]],
        "position": row["r"],
        "orientation": row["p"],
        "velocity": row["v"],
        "angular_velocity": row["w_body"],
    }


def trim(full, last):
    """Return the trimmed file of a full one."""
    definition = full["definition"]
    outputs = [x for x in full["reference"] if x["t"] <= last]
    short = {
        "title": full["title"],
        "source": full["method"],
        "digits": full["digits_vouched"],
        "definition": {
            "gravity": definition["gravity"],
            "bodies": [body(x) for x in definition["bodies"]],
            "constraints": [constraint(x) for x in definition["constraints"]],
        },
        "t": [float(x["t"]) for x in outputs],
    }
    if definition["forces"]:
        short["definition"]["forces"] = [force(x) for x in definition["forces"]]
    for name in ("r", "A", "v", "w_body"):
        short[name] = [[[float(f"{z:.17g}") for z in b[name]] for b in x["bodies"]] for x in outputs]
    short["energy"] = [float(x["energy"]) for x in outputs]
    return short


def text(value, depth=0):
    """JSON with one line an output."""
    if depth < 2 and isinstance(value, (dict, list)) and any(isinstance(x, (dict, list)) for x in _parts(value)):
        pad, end = "\n" + " " * (depth + 1), "\n" + " " * depth
        if isinstance(value, dict):
            rows = [f"{json.dumps(k)}: {text(v, depth + 1)}" for k, v in value.items()]
            return "{" + pad + ("," + pad).join(rows) + end + "}"
        return "[" + pad + ("," + pad).join(text(v, depth + 1) for v in value) + end + "]"
    return json.dumps(value)


def _parts(value):
    return value.values() if isinstance(value, dict) else value


def main(folder):
    """Read the full files of a folder, write the trimmed ones beside this script."""
    for name, last in LAST.items():
        full = json.loads((Path(folder) / f"{name}.json").read_text())
        (Path(__file__).parent / f"{name}.json").write_text(text(trim(full, last)) + "\n")


if __name__ == "__main__":
    main(*sys.argv[1:])
