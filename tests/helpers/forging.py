"""Forged files: mutations of valid ones, with their checksums sealed again, read in a process with bounded memory.

`main` prints, as JSON, how often each outcome was met. A mutation that ends in anything but a solution or a TsdynError,
or that does what files must not do (start a process, load a library), is printed with its number, and the exit code is
1.
"""

import faulthandler
import hashlib
import json
import os
import random
import shutil
import sys
from collections import Counter
from pathlib import Path

import h5py
import numpy as np
import zarr

import tsdyn as ts
from tsdyn.files import checkpoint, saved_file
from tsdyn.jit import cache
from tsdyn.runs import driver

MEMORY = 3 << 30  # bytes beyond what is in use at the start: libraries reserve without use
KINDS = (
    "scene",
    "solution.h5",
    "solution.zarr",
    "ensemble.h5",
    "ensemble.zarr",
    "store",
    "checkpoint",
    "study",
    "kernel",
)
NASTY = [
    None, True, False, 0, -1, 1, 3, 2**31, 2**63, -(2**70), 10**300, 1e308, float("nan"), float("inf"), "", "a", "../a",
    "__class__", "\0", "9" * 50, [], {}, [[]], [0] * 40, {"a": 1}, [None], ["q"], "Taylor", "implicit", 0.5,
]  # fmt: skip
TYPES = "<f8", "<i8", "|u1", "|b1", "<f4", "<u2", "<c16", ">f8", "S3"
FORBIDDEN = ("subprocess.", "os.system", "os.exec", "os.posix_spawn", "os.fork", "socket.", "ctypes.dlopen")


def stopped_soon():
    """A progress report that ends a run after a slice or two."""
    left = [2]

    def report(fraction):
        left[0] -= 1
        if left[0] <= 0:
            raise KeyboardInterrupt

    return report


def scene():
    """A pendulum with a spring, two redundant rows, a driven force and counted turns."""
    made = ts.Scene()
    arm = made.add_body(mass=1.0, inertia=(1.0, 2.0, 3.0), position=(0.5, 0, 0), name="arm")
    bob = made.add_point_mass(1.0, position=(1, 0, 0), name="bob")
    made.add(ts.constraints.Revolute.at(made.ground, arm, point=(0, 0, 0), axis=(0, 1, 0), name="hinge"))
    made.add(ts.constraints.Spherical(arm, bob, point_a=(0.5, 0, 0), name="ball"))
    made.add(ts.constraints.PlaneContact(bob, made.ground, normal_b=(0, 1, 0), name="plane"))
    made.add(ts.forces.TorsionalSpring.at(made.ground, arm, axis=(0, 1, 0), stiffness=3.0, name="coil"))
    made.add(ts.forces.PointForce(bob, force=(np.sin(ts.motions.time), 0.0, 0.0), name="push"))
    return made


def make(kind, folder):
    """A valid file of a kind; its path."""
    name, _, suffix = kind.partition(".")
    path = folder / f"{name}.{suffix or 'h5'}"
    if kind == "scene":
        return scene().save(folder / "scene.toml")
    if name == "solution":
        method = "dop853" if suffix == "h5" else "taylor"
        run = ts.simulate(scene(), (0, 0.5), integrator=method, dense_output=True, events=lambda t, s: s.q[2] + 0.05)
        return run.save(path)
    if name in ("ensemble", "study"):
        store = {"store": path} if name == "study" else {}
        found = ts.ensemble(scene(), {"arm.mass": [1.0, 2.0, 3.0]}, (0, 0.1), **store)
        return path if store else found.save(path)
    stop = stopped_soon() if kind == "checkpoint" else None
    driver.FIRST_SLICE = 4
    end = 60.0 if stop else 0.5
    ts.simulate(scene(), (0, end), integrator="taylor", store=path, checkpoint=0.0, progress=stop)
    return path


def read(kind, path):
    """What a user does with a file of a kind."""
    if kind == "checkpoint":
        return ts.resume(path, progress=stopped_soon()).q
    if kind == "study":
        return ts.ensemble(scene(), {"arm.mass": [1.0, 2.0, 3.0]}, (0, 0.1), store=path, resume=True).q
    found = ts.load(path)
    if kind == "scene":
        return found
    if isinstance(found, ts.Ensemble):
        return found.q, found.status, repr(found), found.to_dataframe(), found.case(0).q
    looks = [found.t, found.q, found.multipliers, found.energy, found.angle("hinge"), str(found), found.message]
    if kind.startswith("solution"):
        looks += [found.at(0.25).q, found.steps, found.charts, found.t_events]
    return looks


def mutated_json(value, rng):
    """Data with one part of it replaced, left out, or doubled."""
    if isinstance(value, dict) and value and rng.random() < 0.9:
        key = rng.choice(list(value))
        if rng.random() < 0.1:
            return {name: part for name, part in value.items() if name != key}
        return {**value, key: mutated_json(value[key], rng)}
    if isinstance(value, list) and value and rng.random() < 0.9:
        i = rng.randrange(len(value))
        return [*value[:i], *([value[i]] * 2 if rng.random() < 0.1 else [mutated_json(value[i], rng)]), *value[i + 1 :]]
    if isinstance(value, (int, float)) and rng.random() < 0.4:
        return value * rng.choice((-1, 2, 10, 1e9)) + rng.choice((-1, 0, 1))
    return rng.choice(NASTY)


def mutated_array(array, rng):
    """An array with other numbers, another type or another shape."""
    array, way = np.array(array), rng.randrange(5)
    if way == 0 and array.size:
        flat = array.reshape(-1).astype(float)
        flat[rng.randrange(array.size)] = rng.choice((np.nan, np.inf, -1.0, 1e9, 2.0**62, -1e300, 0.0, 1.0, 7.0))
        with np.errstate(all="ignore"):
            return flat.reshape(array.shape).astype(array.dtype)
    if way == 1:
        with np.errstate(all="ignore"):
            return array.astype(rng.choice(TYPES))
    if way == 2:
        return array.reshape(-1)[: rng.randrange(array.size + 1)]
    if way == 3:
        return np.concatenate([array.reshape(-1)] * 2) if array.size else np.zeros(rng.randrange(5), array.dtype)
    return np.frombuffer(rng.randbytes(array.nbytes), array.dtype).reshape(array.shape)


def mutate_bytes(path, rng):
    """Flip, cut, insert or repeat bytes of a file."""
    content, way = bytearray(path.read_bytes()), rng.randrange(5)
    at = rng.randrange(len(content) + 1)
    if way == 0:
        content[at : at + 8] = rng.randbytes(8)
    elif way == 1:
        content = content[:at]
    elif way == 2:
        content[at:at] = rng.randbytes(rng.randrange(1, 40))
    elif way == 3:
        content[at : at + 1] = bytes([rng.randrange(256)])
    else:
        content[at:at] = content[at : at + rng.randrange(1, 200)]
    path.write_bytes(bytes(content))


def mutate_text(path, rng):
    """Replace a word of a scene file."""
    words = path.read_text().split(" ")
    i = rng.randrange(len(words))
    words[i] = rng.choice(
        [str(part) for part in NASTY] + words + ["[", "'t**t'", "'1/0'", "\n[[body]]\n", "=", '"', "[a.b]\n"]
    )
    path.write_text(" ".join(words), encoding="utf-8")


def rewritten(path, change):
    """Change the record of a saved solution or ensemble in HDF5, and seal it again."""
    with h5py.File(path, "r+") as file:
        group = file[saved_file.GROUP]
        record = json.loads(saved_file._unsealed(group[saved_file.RECORD][()].tobytes()))
        change(record)
        del group[saved_file.RECORD]
        put(group, saved_file.RECORD, np.frombuffer(saved_file._sealed(json.dumps(record).encode()), np.uint8))


def mutate_saved(path, rng):
    """Change numbers, columns or the record of a saved solution or ensemble, and seal it again."""
    group = h5py.File(path, "r+") if path.suffix == ".h5" else zarr.open_group(path, mode="r+")
    try:
        inner = group[saved_file.GROUP]
        record = json.loads(saved_file._unsealed(np.asarray(inner[saved_file.RECORD][...]).tobytes()))
        arrays = {name: np.asarray(inner[name][...]) for name in list(inner) if name != saved_file.RECORD}
        columns = {c: np.asarray(group[c][...]) for columns in record["tables"].values() for c in columns}
        way, place, known = rng.randrange(3), inner, arrays
        if way == 1 and columns:
            place, known = group, columns
        if way == 0:
            record = mutated_json(record, rng)
        else:
            name = rng.choice(list(known))
            known[name] = mutated_array(known[name], rng)
            del place[name]
            if rng.random() < 0.95:
                put(place, name, known[name])
            if isinstance(record.get("sums"), dict):
                record["sums"][name] = hashlib.sha256(np.ascontiguousarray(known[name]).tobytes()).hexdigest()
        del inner[saved_file.RECORD]
        put(inner, saved_file.RECORD, np.frombuffer(saved_file._sealed(json.dumps(record).encode()), np.uint8))
    finally:
        if path.suffix == ".h5":
            group.close()


def put(group, name, array):
    """Write an array under a name."""
    if isinstance(group, h5py.Group):
        group.create_dataset(name, data=array)
    else:
        group.create_array(name, data=np.ascontiguousarray(array), compressors=None)


def mutate_checkpoint(path, rng):
    """Change the numbers or an array of a checkpoint, and seal it again."""
    numbers, arrays = checkpoint.read(path)
    if rng.random() < 0.5:
        numbers = mutated_json(numbers, rng)
    else:
        name = rng.choice(list(arrays))
        arrays[name] = mutated_array(arrays[name], rng)
    checkpoint.write(path, numbers, arrays)


def mutate_store(path, rng):
    """Change a column of a store."""
    with h5py.File(path, "r+") as file:
        name = rng.choice([name for name in file if file[name].dtype.kind == "f"])
        array = mutated_array(file[name][...], rng)
        del file[name]
        file.create_dataset(name, data=array, maxshape=(None, *array.shape[1:]), chunks=True if array.size else None)


def mutate_node(path, rng):
    """Change the metadata of an array of a folder of Zarr."""
    file = rng.choice(sorted(path.rglob("zarr.json")))
    file.write_text(json.dumps(mutated_json(json.loads(file.read_text()), rng)))


def mutate(kind, path, rng):
    """Change a file of a kind in place."""
    beside = checkpoint.place(path)[0]
    if kind == "scene":
        return (mutate_text if rng.random() < 0.7 else mutate_bytes)(path, rng)
    if path.is_dir() and rng.random() < 0.5:
        if rng.random() < 0.6:
            return mutate_node(path, rng)
        return mutate_bytes(rng.choice(sorted(each for each in path.rglob("*") if each.is_file())), rng)
    if kind == "checkpoint":
        return mutate_checkpoint(path, rng) if rng.random() < 0.9 else mutate_bytes(beside, rng)
    if kind == "store" and rng.random() < 0.4:
        return mutate_checkpoint(path, rng)
    if path.suffix == ".h5" and rng.random() < 0.2:
        return mutate_bytes(path, rng)
    return (mutate_store if kind in ("store", "study") else mutate_saved)(path, rng)


def kernels(count, rng):
    """Load damaged, swapped and forged kernel files; none is taken."""
    tally, folder = Counter(), cache.folder()
    files = sorted(folder.glob("*.kernel"), key=lambda file: file.stat().st_size)[:50]
    for _ in range(count):
        one, other = rng.sample(files, 2)
        content = bytearray(one.read_bytes())
        if rng.random() < 0.5:
            content = bytearray(other.read_bytes())
        else:
            content[rng.randrange(len(content))] ^= 1 + rng.randrange(255)
        forged = folder / f"forged-{one.name}"
        forged.write_bytes(content)
        found = cache.load(forged.name, bytes)
        tally["refused" if found is None and not forged.exists() else "TAKEN"] += 1
    return tally


def main(limit, kind, count, seed, folder):
    """Read so many mutations; the exit code. `limit` is called with the bytes that this process may have."""
    count, seed, folder = int(count), int(seed), Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    faulthandler.enable()
    if kind == "kernel":
        tally = kernels(count, random.Random(seed))
        print(json.dumps(tally))
        return int("TAKEN" in tally)
    whole, tally, faults, watching = folder / "whole", Counter(), [], [False]
    whole.mkdir()
    path = make(kind, whole)
    read(kind, path)

    def watch(event, arguments):
        if watching[0] and event.startswith(FORBIDDEN):
            faults.append(f"{event} {arguments!r:.200}")

    sys.addaudithook(watch)
    used = int(Path("/proc/self/statm").read_text().split()[0]) * os.sysconf("SC_PAGE_SIZE")
    limit(used + MEMORY)
    here = folder / "forged"
    for i in range(seed, seed + count):
        rng = random.Random(i)
        shutil.rmtree(here, ignore_errors=True)
        shutil.copytree(whole, here)
        (folder / "now").write_text(str(i))
        try:
            mutate(kind, here / path.name, rng)
        except Exception as error:
            tally[f"not made: {type(error).__name__}"] += 1
            continue
        watching[0] = True
        try:
            read(kind, here / path.name)
            tally["read"] += 1
        except ts.TsdynError as error:
            tally[type(error).__name__] += 1
        except BaseException as error:
            where = error.__traceback__
            while where.tb_next is not None:
                where = where.tb_next
            faults.append(
                f"{i}: {type(error).__name__}: {error!s:.150} ({where.tb_frame.f_code.co_filename}:{where.tb_lineno})"
            )
        watching[0] = False
    print(json.dumps(tally))
    print("\n".join(faults[:40]), file=sys.stderr)
    return int(bool(faults))
