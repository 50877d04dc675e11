"""What two scenes have in common, to the bit."""

import tsdyn as ts
from tsdyn.files.scene_text import marks


def there_and_back(scene, path):
    """The scene that a file of it gives, the same to the bit as far as data go."""
    twin = ts.load(scene.save(path))
    one, other = marks(scene), marks(twin)
    assert list(one) == list(other)
    for name in one:
        assert one[name] == other[name], name
    assert twin.save(path.with_suffix(".again.toml")).read_bytes() == path.read_bytes()
    return twin


def outcome(scene, **options):
    """Bits of a short run, or why there is none."""
    try:
        solution = ts.simulate(scene, (0.0, 0.02), **options)
    except ts.TsdynError as error:
        return str(error)
    return [getattr(solution, name).tobytes() for name in ("t", "q", "qd", "qdd", "multipliers", "energy")]
