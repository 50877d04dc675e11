"""The page in a browser: it plays, nothing is reported on the console, and a frame takes little script."""

import shutil

import numpy as np
import pytest

import tsdyn as ts
from examples import four_bar

pytestmark = pytest.mark.slow
BROWSERS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
WAIT = 60_000  # ms


@pytest.fixture(scope="module")
def browser():
    play = pytest.importorskip("playwright.sync_api", reason="playwright is not installed: pip install 'tsdyn[test]'")
    found = next(filter(None, map(shutil.which, BROWSERS)), None)
    with play.sync_playwright() as playwright:
        try:
            browser = playwright.chromium.launch(executable_path=found, args=["--no-sandbox"])
        except play.Error as error:
            pytest.skip(f"no Chromium could be started: {error.message.splitlines()[0]}")
        yield browser
        browser.close()


@pytest.fixture
def opened(browser, tmp_path):
    """A page of a run, offline, and what it reports."""
    context = browser.new_context(viewport={"width": 640, "height": 480}, offline=True)
    reports = []

    def open_page(solution, **options):
        page = context.new_page()
        page.on("console", lambda message: reports.append(message.text) if message.type == "error" else None)
        page.on("pageerror", lambda error: reports.append(str(error)))
        page.goto(solution.view(tmp_path / "run", **options).as_uri())
        page.wait_for_function("window.tsdyn && tsdyn.milliseconds() > 0", timeout=WAIT)
        return page, reports

    yield open_page
    context.close()


def picture(page):
    """The canvas, drawn now, as a PNG in base64."""
    return page.evaluate("(draw(), canvas.toDataURL())")


def clock(page):
    return float(page.text_content("#clock").split()[0])


def test_a_page_plays_by_itself_and_loops(opened):
    page, reports = opened(ts.simulate(four_bar.build(), (0.0, 0.5)))
    first = picture(page)
    page.wait_for_function(f"parseFloat(document.getElementById('clock').textContent) != {clock(page)}", timeout=WAIT)
    assert picture(page) != first
    page.evaluate("document.getElementById('speed').value = document.getElementById('speed').options[7].value")
    page.wait_for_function(
        "(window.last ??= 0, window.back = window.back || frame < last, window.last = frame, window.back)", timeout=WAIT
    )
    assert reports == []


def test_controls_do_what_they_say(opened):
    scene = four_bar.build()
    crank = scene.bodies[0]
    page, reports = opened(ts.simulate(scene, (0.0, 1.0)), shapes={crank: ts.shapes.Box((0.4, 0.1, 0.1))})
    page.click("#play")
    page.evaluate("tsdyn.seek(0.25)")
    page.wait_for_function("document.getElementById('clock').textContent.startsWith('0.250')", timeout=WAIT)
    before = picture(page)
    for name in ("reactions", "frames", "joints", "trails", "grid"):
        page.click(f"#show-{name}")
        after = picture(page)
        assert after != before, name
        before = after
    page.select_option("#follow", label=crank.name)
    assert picture(page) != before
    assert reports == []


def test_names_are_shown_on_demand(opened):
    page, reports = opened(ts.simulate(four_bar.build(), (0.0, 0.5)))
    drawn = "(draw(), pen.getImageData(0, 0, names.width, names.height).data.some((x) => x > 0))"
    assert not page.evaluate(drawn)
    page.click("#show-names")
    assert page.evaluate(drawn)
    assert reports == []


def test_a_pass_is_recorded(opened, tmp_path):
    """As WebM, whose files begin with the bytes 1A 45 DF A3."""
    page, reports = opened(ts.simulate(four_bar.build(), (0.0, 2.0)))
    with page.expect_download(timeout=WAIT) as download:
        page.click("#record")
        page.wait_for_function("recorder !== null", timeout=WAIT)
        page.evaluate("frame = run.frames - 2")
    assert download.value.suggested_filename == "tsdyn.webm"
    download.value.save_as(tmp_path / "film")
    assert (tmp_path / "film").read_bytes()[:4] == bytes.fromhex("1A45DFA3")
    assert page.evaluate("recorder === null && !document.querySelector('#record.on')")
    assert reports == []


def test_the_camera_goes_with_what_it_follows(opened):
    """A block at 50 m/s: it stays in the middle, at the distance that its size asks for."""
    scene = ts.Scene(gravity=(0, 0, 0))
    scene.add_body(**ts.shapes.box((1.0, 1.0, 1.0), mass=1.0), velocity=(50, 0, 0), name="block")
    solution = ts.simulate(scene, (0.0, 2.0))
    middle = "(tsdyn.seek({}), draw(), new THREE.Vector3(...placed(0, [0, 0, 0], [0, 0, 0])).project(camera).toArray())"
    for options in ({}, {"follow": "block"}, {"follow": "block", "camera": (1, 0, 0)}):
        page, reports = opened(solution, **options)
        for time in (0.0, 1.0, 2.0):
            np.testing.assert_allclose(page.evaluate(middle.format(time))[:2], 0.0, atol=1e-3)
        assert page.evaluate("camera.position.distanceTo(orbit.target)") < 10.0
    page, reports = opened(solution, camera=[(0, -30, 0), (0, 0, 0)])
    np.testing.assert_allclose(
        page.evaluate("(tsdyn.seek(2), draw(), camera.position.toArray())"), (0, -30, 0), atol=1e-9
    )
    assert reports == []


def test_a_scene_is_a_still_page(opened):
    scene = ts.Scene()
    bob = scene.add_point_mass(mass=1.0, position=(1.2, 0, 0))
    scene.add(ts.constraints.Distance(bob, scene.ground, length=1.0))
    page, reports = opened(scene)
    assert page.is_visible("#show-names")
    assert not page.is_visible("#play")
    assert not page.is_visible("#record")
    assert page.evaluate("pen.getImageData(0, 0, names.width, names.height).data.some((x) => x > 0)")  # violated rows
    assert reports == []


def test_a_trail_goes_through_its_point(opened):
    scene = four_bar.build()
    solution = ts.simulate(scene, (0.0, 1.0))
    page, reports = opened(solution, trails=[("crank", (0.15, 0, 0))])
    way = page.evaluate("[...trails.children[0].geometry.getAttribute('position').array]")
    end = np.reshape(way, (-1, 3))[-1] + page.evaluate("run.origin")
    np.testing.assert_allclose(end, solution.position("crank", point=(0.15, 0, 0))[-1], atol=1e-4)
    assert reports == []


def test_a_contact_changes_its_colour(opened):
    scene = ts.Scene(gravity=(0, 0, -10))
    bead = scene.add_point_mass(mass=1.0, position=(2, 0, 0))
    scene.add(ts.constraints.PlaneContact(bead, scene.ground, normal_b=(0, 0, 1)))
    scene.add(ts.forces.Spring(bead, scene.ground, point_b=(0, 0, 1), stiffness=20.0, free_length=0.6))
    solution = ts.simulate(scene, (0.0, 3.0))
    middle = float(solution.t[np.abs(solution.position(bead)[:, 0]).argmin()])
    page, reports = opened(solution)
    colours = []
    for time in (0.0, middle):
        page.evaluate(f"(tsdyn.seek({time}), draw())")
        (contact,) = page.evaluate(
            "contacts.map(({ mesh, place }) => [...mesh.instanceColor.array.slice(3 * place / 16, 3 * place / 16 + 3)])"
        )
        colours.append(contact)
    (red, green), (red_later, green_later) = (colour[:2] for colour in colours)
    assert red > green
    assert green_later > red_later
    assert "contacts: green pushes" in page.text_content("#legend")
    assert reports == []


def test_a_frame_of_fifty_bodies_takes_little_script(opened):
    """Instances of few meshes: as many draw calls as for two bodies."""
    from tests.helpers.hanging_chains import pendulums

    calls = []
    for count in (2, 50):
        page, reports = opened(ts.simulate(pendulums([0.3] * count), (0.0, 0.05)))
        calls.append(page.evaluate("renderer.info.render.calls - trailOf.size"))
        assert reports == []
    assert calls[0] == calls[1]
